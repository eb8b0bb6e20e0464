"""Autopilots of one thing each: course rate by the rudder, depth by the elevators, roll by their difference."""

from collections.abc import Mapping

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..errors import InputError
from ..parameters import number
from ..vehicle import AbstractVehicle
from .limits import FinLimits
from .loops import Loop, angle_loop, axis, rate_loop

PAIR = ("elevator_right", "elevator_left")
# of the hull's fastest eigenvalue: an unstable hull needs about that, and noise forbids more
_PART = 0.75
# half of a fin is left for damping and for noise
_RESERVE = 0.5


class CourseRate(eqx.Module):
    """Rudder from yaw rate.

    **Fields**

    - `loop`: rad of rudder from rad/s. `fastest`: the largest rate it steers for, rad/s.
    """

    loop: Loop
    fastest: Float[Array, ""]

    @classmethod
    def of(cls, vehicle: AbstractVehicle, limits: FinLimits) -> "CourseRate":
        """Poles at three quarters of the fastest of `vehicle` in sway and yaw; deflections keep `limits`.

        Full rudder can only just hold an unstable hull at its steady rate, so one is steered for half of that at most.

        **Raises** `InputError` for a vehicle without a rudder that turns it.
        """
        _require(vehicle, "yaw", (("rudder",),))
        yaw = axis(vehicle, ("sway", "yaw"), "psi", {"rudder": 1.0}, "N_delta_r")
        authority = _RESERVE * float(limits.amplitude)
        fastest = abs(yaw.steady) * authority if yaw.growth >= 0.0 else np.inf
        return cls(rate_loop(yaw, _PART * yaw.swiftness, authority), number(float(fastest)))

    def error(self, shown: Mapping[str, Array], reference: Mapping[str, Array]) -> Float[Array, ""]:
        """The yaw rate of the `reference` less that `shown`, rad/s; both by name, SI."""
        return jnp.clip(reference["course_rate"], -self.fastest, self.fastest) - shown["r"]


class Depth(eqx.Module):
    r"""Elevators from depth: a loop from depth to pitch around one from pitch to elevators.

    With the depth error e and $\dot z \approx -U_c\theta$ the commanded pitch is $\theta = -(\lambda e + h)/U_c$,
    $\dot h = \mu(\lambda e - \dot z)$: the integral learns the pitch of level flight only from a descent that differs
    from the commanded one, so that depth follows its reference as $\lambda/(s + \lambda)$, without overshoot.

    **Fields**

    - `pace`: λ, 1/s. `outer`: rad of pitch from m. `inner`: rad of elevator from rad.
    - `steepest`: largest commanded pitch, rad.
    - `fins`: the elevators that move together.
    """

    pace: Float[Array, ""]
    outer: Loop
    inner: Loop
    steepest: Float[Array, ""]
    fins: tuple[str, ...] = eqx.field(static=True)

    @classmethod
    def of(cls, vehicle: AbstractVehicle, limits: FinLimits, pitch_limit: float) -> "Depth":
        """Pitch poles at three quarters of the fastest of `vehicle` in heave and pitch, λ = 2μ a seventh of their mean.

        Deflections keep `limits`, and the commanded pitch `pitch_limit`, rad. **Raises** `InputError` for a vehicle
        without elevators or stern plane that pitch it, or without a depth.
        """
        fins = _require(vehicle, "pitch", (PAIR, ("elevator",), ("stern_plane",)))
        if not all(map(vehicle.layout.tells, ("z", "theta"))):
            raise InputError(vehicle.layout.name, "has no depth to hold", "free its heave and pitch")
        pitch = axis(vehicle, ("heave", "pitch"), "theta", dict.fromkeys(fins, 1.0), "M_delta_e or M_delta_s")
        inner = angle_loop(pitch, _PART * pitch.swiftness, _RESERVE * float(limits.amplitude))
        pace, speed = pitch.natural / 7.0, vehicle.speed
        outer = Loop.of(-pace / speed, -0.5 * pace**2 / speed)
        return cls(number(pace), outer, inner, number(float(pitch_limit)), fins)

    def errors(
        self,
        held: Array,
        shown: Mapping[str, Array],
        reference: Mapping[str, Array],
        descent: Array,
    ) -> tuple[Array, Array, Array]:
        """Error of the pitch (rad), of the depth that its integral learns from (m), and pitch not acted on (rad).

        `shown` are measured channels and `reference` the wanted ones, by name, SI; `held` is the integral of depth and
        `descent` the rate of it, m/s.
        """
        below = reference["depth"] - depth_of(shown)
        wanted = self.outer.demand(below, held)
        error = jnp.clip(wanted, -self.steepest, self.steepest) - shown["theta"]
        surplus = wanted - shown["theta"] - jnp.clip(error, -self.inner.reach, self.inner.reach)
        return error, below - descent / self.pace, surplus


class Roll(eqx.Module):
    """Half the difference of the elevators from roll.

    **Fields**

    - `loop`: rad of each elevator from rad.
    """

    loop: Loop

    @classmethod
    def of(cls, vehicle: AbstractVehicle, limits: FinLimits) -> "Roll":
        """Poles half as fast as those of `vehicle` in roll: noise must not keep the elevators busy.

        Deflections keep `limits`. **Raises** `InputError` for a vehicle without two elevators that roll it.
        """
        _require(vehicle, "roll", (PAIR,))
        roll = axis(vehicle, ("roll",), "phi", {PAIR[0]: 1.0, PAIR[1]: -1.0}, "K_delta_er")
        return cls(angle_loop(roll, 0.5 * roll.swiftness, _RESERVE * float(limits.amplitude)))


def depth_of(shown: Mapping[str, Array]) -> Array:
    """The depth by either of its names, m."""
    return shown["z" if "z" in shown else "depth"]


def _require(vehicle: AbstractVehicle, equation: str, ways: tuple[tuple[str, ...], ...]) -> tuple[str, ...]:
    """The first of `ways` to turn `vehicle` that it has the actuators for."""
    layout = vehicle.layout
    if equation not in layout.equations:
        raise InputError(layout.name, f"is not free in {equation}", f"add {equation} to its dof")
    names = {name for name, _ in layout.inputs}
    for way in ways:
        if names.issuperset(way):
            return way
    wanted = " or ".join(" and ".join(way) for way in ways)
    raise InputError(layout.name, f"has nothing to steer {equation} with", f"give it {wanted} under [inputs]")
