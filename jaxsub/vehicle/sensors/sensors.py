"""What the sensors of a vehicle show of its motion."""

import dataclasses
from collections.abc import Mapping
from typing import Self

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...arrays import Values
from ...effects import EQUATIONS, Motion, Signal
from ...parameters import number
from ..kinematics import rotation, specific_force, to_earth
from .earth import radii
from .output import GEODETIC, POSITION, SPECIFIC_FORCE, TRIADS, TURNING, VELOCITY, WRAPS, Output
from .water import depth_at, pressure

MOUNTING = ("mounting_roll", "mounting_pitch", "mounting_yaw")


class Sensors(eqx.Module):
    r"""$z = s\,c(\nu, \dot\nu, \eta) + o$ for each output: its channel c at the sensor, in the sensor's axes, and form.

    At a lever arm l a velocity is $\nu_1 + \nu_2\times l$, a position $\eta_1 + R\,l$, and a specific force
    $\dot\nu_1 + \nu_2\times\nu_1 + \dot\nu_2\times l + \nu_2\times(\nu_2\times l) - R^Tg$. An instrument that is
    mounted at angles $(\phi_m, \theta_m, \psi_m)$ to the body's axes shows $R(\phi_m, \theta_m, \psi_m)^T$ times the
    vector. Source: Titterton and Weston (2004), §3 and §4; Fossen (2021), §14.

    **Fields**

    - `numbers`: s as `NAME.scale`, o as `NAME.offset`, angles as `NAME.mounting_yaw` (rad); those that there are.
    - `density`: of the water where an output states none, kg/m³.
    """

    numbers: dict[str, Float[Array, ""]] = eqx.field(default_factory=dict)
    density: float | None = eqx.field(static=True, default=None)

    def with_values(self, values: Mapping[str, Values]) -> Self:
        """The same sensors with other numbers, the `values` (SI) by name."""
        return dataclasses.replace(self, numbers={n: number(values.get(n, old)) for n, old in self.numbers.items()})

    def show(self, output: Output, channels: Mapping[str, Signal], motion: Motion) -> Signal:
        """The sensor's signal by `output` in `motion`, given the `channels` at the origin of the body's axes, SI."""
        channel, sign, constant = output.framed
        shown = self._at_sensor(output, channel, channels, motion)
        if output.frame:
            shown = sign * shown + constant
        return self.recorded(output.name, shown)

    def recorded(self, name: str, true: Signal) -> Signal:
        """A true signal as the column `name` has it: scaled and offset."""
        scale, offset = self._line(name)
        true = true if scale is None else scale * true
        return true if offset is None else true + offset

    def corrects(self, name: str) -> bool:
        """Whether the column `name` is scaled or offset."""
        return any(part is not None for part in self._line(name))

    def true(self, name: str, recorded: Signal) -> Signal:
        """The column `name` as the signal that it shows: the inverse of `recorded`."""
        scale, offset = self._line(name)
        recorded = recorded if offset is None else recorded - offset
        return recorded if scale is None else recorded / scale

    def channel_of(self, output: Output, recorded: Values) -> Values:
        """A `recorded` column in the form of the state that `output` shows (`Output.state`).

        Arms and mountings stay in it.
        """
        _, sign, constant = output.framed
        value = sign * (self.true(output.name, recorded) - constant)
        if output.channel == "pressure":
            return depth_at(value, self._water(output), output.latitude)
        if output.channel in GEODETIC:
            at = GEODETIC.index(output.channel)
            return (value - output.origin[at]) * radii(output.origin[0])[at]
        return value

    def _line(self, name: str) -> tuple[Values | None, Values | None]:
        return self.numbers.get(f"{name}.scale"), self.numbers.get(f"{name}.offset")

    def _water(self, output: Output) -> float | None:
        return output.density or self.density

    def _at_sensor(self, output: Output, channel: str, channels: Mapping[str, Signal], motion: Motion) -> Signal:
        if channel == "beam":
            return self._vector(output, VELOCITY, motion) @ jnp.asarray(output.direction)
        if channel in GEODETIC:
            at = GEODETIC.index(channel)
            moved = _position(output, "xy"[at], channels, motion)
            return output.origin[at] + moved / radii(output.origin[0])[at]
        if channel == "pressure":
            return pressure(_position(output, "z", channels, motion), self._water(output), output.latitude)
        if channel in POSITION:
            return _position(output, channel, channels, motion)
        for triad in TRIADS:
            if channel in triad and (triad is SPECIFIC_FORCE or self._moved(output)):
                return self._vector(output, triad, motion)[..., triad.index(channel)]
        return channels[channel]

    def _moved(self, output: Output) -> bool:
        """Whether a sensor sits off the origin or askew."""
        return any(output.lever_arm) or any(f"{output.table}.{angle}" in self.numbers for angle in MOUNTING)

    def _vector(self, output: Output, triad: tuple[str, ...], motion: Motion) -> Float[Array, "*k 3"]:
        """The velocity, rate or specific force at a sensor in its own axes."""
        turning = _stacked(motion.rates, EQUATIONS[3:])
        if triad is SPECIFIC_FORCE:
            still = jnp.zeros_like(turning[..., 0])
            full = {e: motion.accelerations.get(e, still) for e in EQUATIONS}
            vector = _stacked(specific_force(motion, full, output.lever_arm), SPECIFIC_FORCE)
        elif triad is TURNING:
            vector = turning
        else:
            vector = _stacked(motion.rates, EQUATIONS[:3])
            if any(output.lever_arm):
                vector = vector + jnp.cross(turning, jnp.broadcast_to(jnp.asarray(output.lever_arm), turning.shape))
        angles = [self.numbers.get(f"{output.table}.{angle}") for angle in MOUNTING]
        if all(angle is None for angle in angles):
            return vector
        # R^T v, as a product from the right
        return vector @ rotation(*(jnp.zeros(()) if angle is None else angle for angle in angles))


def recorded_columns(outputs: tuple[Output, ...], shown: Float[np.ndarray, "k c"]) -> dict[str, np.ndarray]:
    """`shown` (K, c), SI, of `outputs`, by column of a log; headings within the turn in which their column is."""

    def written(output: Output, values: np.ndarray) -> np.ndarray:
        if not output.wrap:
            return values
        begin = WRAPS[output.wrap]
        return begin + np.mod(values - begin, 2.0 * np.pi)

    return {output.column: written(output, np.array(own)) for output, own in zip(outputs, shown.T, strict=True)}


def _position(output: Output, channel: str, channels: Mapping[str, Signal], motion: Motion) -> Signal:
    if not any(output.lever_arm):
        return channels[channel]
    row = {"x": 0, "y": 1}.get(channel, 2)
    return channels[channel] + to_earth(motion.positions)[..., row, :] @ jnp.asarray(output.lever_arm)


def _stacked(named: Mapping[str, Signal], keys: tuple[str, ...]) -> Float[Array, "*k 3"]:
    return jnp.stack(jnp.broadcast_arrays(*(jnp.asarray(named[key]) for key in keys)), -1)
