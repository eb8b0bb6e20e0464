r"""Limits of a manoeuvre's actuators and motion, and inputs that keep the actuators' limits.

An actuator follows a command $c_k$ as a servo of limited rate $\dot\delta_{max}$ does:
$\delta_k = \delta_{k-1} + s_k\tanh\bigl((c_k - \delta_{k-1})/s_k\bigr)$ with $s_k = \dot\delta_{max}\Delta_k$. As
$|\tanh x| \le \min(1, |x|)$ it moves by no more than $s_k$ and never past its command, so with
$|c_k| \le \delta_{max}$ both limits hold exactly, and the deflection is a smooth function of every command before it.
"""

import dataclasses
from collections.abc import Iterable, Mapping, Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..errors import InputError, nearest
from ..recording import Recording
from ..recording.runs import Runs, stack_runs
from ..vehicle import AbstractVehicle

_STARTED = 0.9  # of the way to the limits, where the commands of a start are put at most

Range = float | tuple[float, float]


@dataclasses.dataclass(frozen=True)
class ManoeuvreLimits:
    """Limits of a manoeuvre, SI.

    **Fields**

    - `amplitude`: largest deflection of each actuator, by its column in a recording.
    - `rate`: largest rate of each, per s; an actuator that is not named may jump.
    - `channels`: largest size of any channel that the vehicle can produce, measured or not, such as `theta` or `z`.
    - `energy`: largest $\\sum_a\\int\\delta_a^2\\,dt$ of all actuators together.

    An amplitude or a channel whose two sides differ, such as a shaft speed or a depth, has a pair: least and largest.
    """

    amplitude: Mapping[str, Range]
    rate: Mapping[str, float] = dataclasses.field(default_factory=dict)
    channels: Mapping[str, Range] = dataclasses.field(default_factory=dict)
    energy: float = np.inf

    def check(self, vehicle: AbstractVehicle) -> None:
        """Raise `InputError` for a name that `vehicle` does not have, a missing amplitude, a limit that is not > 0."""
        held = vehicle.layout.held
        for name in held:
            if name not in self.amplitude:
                raise InputError("limits", f"no amplitude for the actuator {name!r}", "give one for every actuator")
        for kind, given in (("amplitude", self.amplitude), ("rate", self.rate)):
            _require_known(kind, given, held)
        _require_known("channel", self.channels, producible(vehicle))
        for name, value in (
            *self.amplitude.items(),
            *self.rate.items(),
            *self.channels.items(),
            ("energy", self.energy),
        ):
            low, high = _sides(value)
            # an actuator with a pair of equal sides stays where it is
            if not (high > low or (name in self.amplitude and isinstance(value, tuple) and high == low)):
                raise InputError("limits", f"{name!r} is limited to {value}", "a limit is above zero, or a pair")


class Bounds(eqx.Module):
    """Limits as arrays for one vehicle and one set of times.

    **Fields**

    - `low`, `high`: (m,). `begin`: (m,) the actuators before the run.
    - `step`: (K, m) largest change of each actuator up to each sample, first from `begin`.
    - `weights`: (K,) s that each sample's inputs last. `energy`: of all actuators together.
    - `channel_low`, `channel_high`: (c,) of `channels`.
    """

    low: Float[Array, " m"]
    high: Float[Array, " m"]
    begin: Float[Array, " m"]
    step: Float[Array, "k m"]
    weights: Float[Array, " k"]
    energy: Float[Array, ""]
    channel_low: Float[Array, " c"]
    channel_high: Float[Array, " c"]
    channels: tuple[str, ...] = eqx.field(static=True)

    @classmethod
    def of(
        cls, vehicle: AbstractVehicle, limits: ManoeuvreLimits, times: np.ndarray, begin: np.ndarray | None = None
    ) -> "Bounds":
        """The limits for `vehicle` at `times` (K,), s, its actuators at `begin` (m,), or zero, before that."""
        limits.check(vehicle)
        held = vehicle.layout.held
        gaps = np.diff(times)
        low, high = _columns([limits.amplitude[name] for name in held])
        rate = np.array([limits.rate.get(name, np.inf) for name in held])
        # a step so long that the servo is a jump to within rounding
        jump = 1e6 * np.maximum(np.maximum(np.abs(low), np.abs(high)), np.finfo(float).tiny)
        step = np.minimum(np.append(gaps[0], gaps)[:, None] * rate, jump)
        channel_low, channel_high = _columns(limits.channels.values())
        return cls(
            jnp.asarray(low),
            jnp.asarray(high),
            jnp.zeros(len(held)) if begin is None else jnp.asarray(begin),
            jnp.asarray(step),
            jnp.asarray(np.append(gaps, 0.0)),
            jnp.asarray(limits.energy),
            jnp.asarray(channel_low),
            jnp.asarray(channel_high),
            tuple(limits.channels),
        )

    def follow(self, commands: Float[Array, "k m"]) -> Float[Array, "k m"]:
        """What the actuators do when given `commands`; commands past the amplitude are cut there."""
        return self.scaled(_servo(jnp.clip(commands, self.low, self.high), self.step, self.begin))

    def inputs(self, free: Float[Array, "k m"]) -> Float[Array, "k m"]:
        """The same for commands that tanh(`free`) puts between the limits: smooth, and inside whatever `free` is."""
        middle, half = 0.5 * (self.low + self.high), 0.5 * (self.high - self.low)
        return self.scaled(_servo(middle + half * jnp.tanh(free), self.step, self.begin))

    def free(self, inputs: Float[Array, "k m"]) -> Float[Array, "k m"]:
        """What makes commands of `inputs`, drawn a little to the middle: at the limits tanh has no slope."""
        middle, half = 0.5 * (self.low + self.high), 0.5 * (self.high - self.low)
        return jnp.arctanh(_STARTED * jnp.clip((inputs - middle) / jnp.where(half > 0.0, half, 1.0), -1.0, 1.0))

    def scaled(self, inputs: Float[Array, "k m"]) -> Float[Array, "k m"]:
        """`inputs`, made smaller by one factor where their energy is above the limit."""
        spent = jnp.sum(self.weights[:, None] * inputs**2)
        over = spent > self.energy
        return jnp.where(over, jnp.sqrt(self.energy / jnp.where(over, spent, 1.0)), 1.0) * inputs

    def used(self, vehicle: AbstractVehicle, states: Float[Array, "k s"], signals: Float[Array, "k m2"]) -> Array:
        """The limited channels along a trajectory, (K, c), in their limits: inside where within -1 and 1."""
        motion = vehicle.motion(states, signals)
        shown = vehicle.channels(motion)
        columns = [jnp.broadcast_to(shown[name], states.shape[:1]) for name in self.channels]
        if not columns:
            return jnp.zeros((len(states), 0))
        middle, half = 0.5 * (self.channel_low + self.channel_high), 0.5 * (self.channel_high - self.channel_low)
        return (jnp.stack(columns, axis=1) - middle) / half


@jax.jit
def _servo(commands: Float[Array, "k m"], step: Float[Array, "k m"], begin: Float[Array, " m"]) -> Float[Array, "k m"]:
    def follow(deflection: Array, sample: tuple[Array, Array]) -> tuple[Array, Array]:
        command, most = sample
        after = deflection + most * jnp.tanh((command - deflection) / most)
        return after, after

    return jax.lax.scan(follow, begin, (commands, step))[1]


def producible(vehicle: AbstractVehicle) -> tuple[str, ...]:
    """The channels that `vehicle` can produce without an accelerometer."""
    layout = vehicle.layout
    size = len(layout.equations) + len(layout.positions)
    motion = vehicle.motion(jnp.zeros(size), jnp.zeros(len(layout.held + layout.interpolated)))
    return tuple(vehicle.channels(motion))


def manoeuvre(
    vehicle: AbstractVehicle,
    name: str,
    times: np.ndarray,
    inputs: np.ndarray,
    surroundings: Mapping[str, np.ndarray],
) -> Recording:
    """A recording of `inputs` (K, m) at `times` (K,), s, that a simulation can be driven by; its outputs are blank."""
    layout = vehicle.layout
    columns = {column: np.full(len(times), np.nan) for column in layout.columns}
    columns |= {column: np.asarray(surroundings[column]) for column in layout.interpolated if column in surroundings}
    columns |= dict(zip(layout.held, np.asarray(inputs, float).T, strict=True))
    return Recording(name, times, columns, name)


def template(vehicle: AbstractVehicle, recordings: Sequence[Recording]) -> Runs:
    """Runs driven by `recordings` in which every channel is to be measured at every sample."""
    layout = vehicle.layout
    shown = [name for name in layout.columns if name not in layout.interpolated]
    measured = [
        dataclasses.replace(r, columns=r.columns | dict.fromkeys(shown, np.zeros(len(r.times)))) for r in recordings
    ]
    return stack_runs(measured, held=layout.held, interpolated=layout.interpolated, channels=layout.columns)


def _sides(limit: Range) -> tuple[float, float]:
    """Least and largest."""
    return limit if isinstance(limit, tuple) else (-limit, limit)


def _columns(limits: Iterable[Range]) -> tuple[np.ndarray, np.ndarray]:
    """The least of each, and the largest."""
    sides = np.array([_sides(limit) for limit in limits], float).reshape(-1, 2)
    return sides[:, 0], sides[:, 1]


def _require_known(kind: str, given: Mapping[str, Range], known: Sequence[str]) -> None:
    for name in given:
        if name not in known:
            close = nearest(name, known)
            remedy = f"did you mean {close!r}?" if close else f"there are {', '.join(known)}"
            raise InputError("limits", f"the vehicle has no {kind} {name!r}", remedy)
