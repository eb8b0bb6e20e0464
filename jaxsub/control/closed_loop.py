"""Closed-loop simulation: a vehicle under its autopilot, sampled."""

from collections.abc import Mapping

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..effects import AbstractSensor
from ..errors import InputError, nearest
from ..programs import compiled
from ..recording import Recording
from ..recording.runs import Runs, stack_runs
from ..simulation import Sampled, at_rest
from ..vehicle import AbstractVehicle, recorded_columns
from .autopilot import REFERENCES, Autopilot

_LOST = np.radians(60.0)


class _Flight(eqx.Module):
    """What is known before a flight; arrays by name, (K,) each, and (K, c) noise."""

    vehicle: AbstractVehicle
    autopilot: Autopilot
    runs: Runs
    reference: dict[str, Float[Array, " k"]]
    override: dict[str, Float[Array, " k"]]
    noise: Float[Array, "k c"]


def fly(
    vehicle: AbstractVehicle,
    autopilot: Autopilot,
    reference: Mapping[str, np.ndarray],
    times: np.ndarray,
    *,
    seed: int,
    noise: bool = True,
    start: Float[Array, " s"] | None = None,
    given: Mapping[str, np.ndarray] | None = None,
    name: str = "flight",
) -> Recording:
    """The recording of a flight of `vehicle` under `autopilot`, by the sampled step.

    At each of `times` (K,) s the autopilot is shown what the sensors show, with `noise` drawn by `seed`, and its
    deflections are held until the next. Columns are the inputs as flown, before any actuator of the vehicle's effects,
    and the measured channels, SI; to simulate the inputs by `synthetic` with `sampled_states`, the same `start` and
    `seed` gives the same recording, of which `name` is the name.

    - `reference`: (K,) each of `course_rate` (rad/s), `depth` (m), `roll` (rad); zero where absent.
    - `given`: (K,) by input column. One that the autopilot moves follows this instead, within its fin's limits; the
      vehicle's other inputs, prescribed motions and surroundings all have to be here.
    - `start`: (s,) the initial state, SI, by default level and straight on at the operating speed.

    **Raises** `InputError` for a channel, a reference or a column that is missing, unknown or of another length, and
    for a vehicle that is lost: not finite, or pitched or adrift by more than 60°.
    """
    given = {} if given is None else given
    _check(vehicle, autopilot, reference, given, times)
    layout = vehicle.layout
    runs = _before(vehicle, times, given)
    sigma = np.array([(output.sigma or 0.0) * noise for output in layout.outputs])
    draws = sigma * np.random.default_rng([seed, 0]).standard_normal((len(times), len(sigma)))
    wanted = {key: jnp.asarray(reference.get(key, np.zeros(len(times))), float) for key in REFERENCES}
    moved = [(fin, column) for fin, column in layout.inputs if fin in autopilot.limits and column in given]
    override = {fin: jnp.asarray(given[column], float) for fin, column in moved}
    flight = _Flight(vehicle, autopilot, runs, wanted, override, jnp.asarray(draws))
    flown = _flown(flight, at_rest(vehicle, 1)[0] if start is None else start)
    states, signals, outputs = (np.asarray(part) for part in flown)
    source = f"{layout.name}, {name}"
    _require_control(vehicle, source, times, states, signals)
    measured = recorded_columns(layout.outputs, outputs + draws)
    inputs = dict(zip((*layout.held, *layout.interpolated), signals.T, strict=True))
    return Recording(name, times, measured | inputs, source)


def _before(vehicle: AbstractVehicle, times: np.ndarray, given: Mapping[str, np.ndarray]) -> Runs:
    """The run before it is flown, fins at zero, and one sample longer: the last deflection has an interval too."""
    layout = vehicle.layout
    longer = np.append(times, 2.0 * times[-1] - times[-2])
    columns = dict.fromkeys(layout.columns, np.full(len(longer), np.nan))
    for column in (*layout.held, *layout.interpolated):
        samples = given.get(column, np.zeros(len(times)))
        columns[column] = np.append(samples, samples[-1])
    blank = Recording("flight", longer, columns, f"{layout.name}, given columns")
    return stack_runs([blank], held=layout.held, interpolated=layout.interpolated, channels=layout.columns)


@compiled
def _flown(flight: _Flight, start: Array) -> tuple[Float[Array, "k s"], Float[Array, "k m"], Float[Array, "k c"]]:
    """States, signals and outputs at the samples."""
    vehicle, runs = flight.vehicle, flight.runs
    times, step_of, steps = runs.times[0], runs.step_of[0], runs.steps
    since = steps[jnp.concatenate([step_of[:1], step_of[:-1]])]
    model = Sampled.of(vehicle, runs)
    fins = {name: i for i, (name, _) in enumerate(vehicle.layout.inputs) if name in flight.autopilot.limits}

    def advance(carry: tuple, sample: tuple) -> tuple[tuple, Array]:
        state, memory, nodes = carry
        k, reference, override, noise = sample
        outputs = vehicle.measure(times[k], state, nodes[k, 0]) + noise
        shown = dict(zip(vehicle.layout.channels, outputs, strict=True))
        memory, deflections = flight.autopilot.command(memory, shown, reference, since[k], override)
        for name, column in fins.items():
            nodes = nodes.at[k, :, column].set(deflections[name])
        # an actuator answers to the whole history of its command; what is still to come does not reach back
        after = model.step(state, vehicle.actuate(times, nodes)[k], step_of[k])
        return (after, memory, nodes), state

    samples = (jnp.arange(len(step_of)), flight.reference, flight.override, flight.noise)
    (_, _, nodes), states = jax.lax.scan(advance, (start, flight.autopilot.init(), runs.nodes()[0]), samples)
    signals = nodes[:, 0, :-1]  # less the time
    return states, signals, vehicle.measure(times[:-1], states, signals)


def _check(
    vehicle: AbstractVehicle,
    autopilot: Autopilot,
    reference: Mapping[str, np.ndarray],
    given: Mapping[str, np.ndarray],
    times: np.ndarray,
) -> None:
    layout = vehicle.layout
    if len(times) < 2:
        raise InputError(f"{layout.name}: times", f"has {len(times)} samples", "a flight needs at least two")
    for ways in autopilot.channels:
        if not set(ways) & set(layout.channels):
            raise InputError(f"{layout.name}: outputs", f"has no {' or '.join(ways)} to steer by", "measure it")
    for effect in vehicle.effects:
        if isinstance(effect, AbstractSensor) and effect.remembers:
            raise InputError(layout.name, f"an autopilot cannot hold the memory of {effect.label}", "fly without it")
    columns = (*layout.held, *layout.interpolated)
    for kind, table, known in (("reference", reference, REFERENCES), ("given column", given, columns)):
        for key, values in table.items():
            if key not in known:
                close = nearest(key, known)
                remedy = f"did you mean {close!r}?" if close else f"known are {', '.join(known)}"
                raise InputError(f"{kind} {key!r}", f"{layout.name} has none", remedy)
            if np.shape(values) != np.shape(times):
                what = f"has shape {np.shape(values)} beside {len(times)} times"
                raise InputError(f"{kind} {key!r}", what, "give one sample for each time")
    moved = {column for fin, column in layout.inputs if fin in autopilot.limits}
    for column in columns:
        if column not in moved and column not in given:
            raise InputError(f"input {column!r}", f"no autopilot of {layout.name} moves it", "give its samples")


def _require_control(
    vehicle: AbstractVehicle, source: str, times: np.ndarray, states: np.ndarray, signals: np.ndarray
) -> None:
    motion = vehicle.motion(jnp.asarray(states), jnp.asarray(signals))
    u, v, w = (np.asarray(motion.rates[name]) for name in ("surge", "sway", "heave"))
    astray = np.maximum(np.abs(np.asarray(motion.positions["theta"])), np.arctan2(np.hypot(v, w), u))
    lost = ~(np.isfinite(states).all(axis=1) & (astray < _LOST))
    if lost.any():
        what = f"is lost by {times[int(np.argmax(lost))]:g} s: pitched or adrift by more than 60°"
        raise InputError(source, what, "ask less of it, give its fins more, or sample it faster")
