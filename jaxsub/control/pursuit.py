"""A predictive controller flown against a truth, sample by sample in real time."""

import dataclasses
import time
from collections.abc import Mapping

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..errors import InputError
from ..filter import AbstractFilter, FilterState, Sample
from ..programs import compiled
from ..recording import Recording
from ..simulation import at_rest
from ..vehicle import recorded_columns
from .mpc import Mpc, MpcPlan, Solved
from .observers import Drive, observer
from .plant import Plant


@dataclasses.dataclass(frozen=True)
class Pursuit:
    """A flight under a predictive controller.

    **Fields**

    - `recording`: inputs as given and measured channels.
    - `truth`: (K,) each of the tracked and bounded channels, true, SI.
    - `wanted`: (K, t) references, SI. `inputs`: (K, m) as given, SI.
    - `seconds`, `work`: (K,) wall-clock and processor time of each sample's estimate and plan, s, without compiling.
    - `solved`: of each sample, stacked.
    """

    recording: Recording
    truth: dict[str, np.ndarray]
    wanted: np.ndarray
    inputs: np.ndarray
    seconds: np.ndarray
    work: np.ndarray
    solved: Solved


def pursue(
    truth: Plant,
    mpc: Mpc,
    wanted: Mapping[str, np.ndarray],
    *,
    seed: int,
    noise: bool = True,
    start: Float[Array, " n"] | None = None,
    name: str = "pursuit",
) -> Pursuit:
    """`truth` under `mpc`, which knows of it what the sensors show and what will be wanted.

    `wanted` are (K,) references by tracked channel, SI; the controller sees those of its horizon. It estimates its own
    plant's state by `observer` from the truth's sensors with their `noise`, drawn by `seed`. `start` (n,) is the
    vehicle's state of the truth, SI, and `name` that of the recording.

    **Raises** `InputError` where plants differ in interval, inputs or outputs, a reference is missing, or a number
    ceases to be finite.
    """
    _check(truth, mpc, wanted)
    table = np.stack([np.asarray(wanted[channel], float) for channel in mpc.weights.track], axis=1)
    ahead = np.concatenate([table, np.repeat(table[-1:], mpc.samples, axis=0)])
    layout = truth.vehicle.layout
    sigma = np.array([output.sigma or 0.0 for output in layout.outputs])
    draws = noise * sigma * np.random.default_rng([seed, 0]).standard_normal((len(table), len(sigma)))
    assumed = jnp.asarray(np.where(sigma > 0.0, sigma, 1e-3))
    follower = observer(mpc.plant, assumed)
    own = at_rest(truth.vehicle, 1)[0] if start is None else start
    u = mpc.weights.rest
    x = truth.start(own, u)
    shared = at_rest(mpc.plant.vehicle, 1)[0]
    count = min(truth.own, mpc.plant.own)
    known = mpc.plant.start(shared.at[:count].set(own[:count]), u)
    state, plan = follower.start(known, jnp.zeros(0), jnp.zeros((0, 0))), mpc.start(u)
    rows: list[tuple] = []
    for k in range(len(table)):
        now = jnp.asarray(k * truth.dt)
        shown = _shown(truth, x, u, now)
        measured = shown[0] + draws[k]
        reference = jnp.asarray(ahead[k + 1 : k + 1 + mpc.samples])
        sample = Sample(Drive(u, u, now), jnp.asarray(truth.dt if k else 0.0), measured, jnp.ones(len(sigma), bool))
        for _ in range(1 if k else 2):  # the first call compiles
            begin, work = time.perf_counter(), time.process_time()
            decided = jax.block_until_ready(_decided(mpc, follower, state, plan, sample, reference))
            taken = time.perf_counter() - begin, time.process_time() - work
        state, plan, u, solved = decided
        rows.append((np.asarray(measured), np.asarray(u), shown[1], solved, *taken))
        x = _moved(truth, x, u, now)
    return _assembled(truth, mpc, table, rows, name)


@compiled
def _shown(truth: Plant, x: Array, u: Array, now: Array) -> tuple[Array, dict[str, Array]]:
    return truth.output(x, u, now), truth.channels(x, u, now)


@compiled
def _moved(truth: Plant, x: Array, u: Array, now: Array) -> Array:
    return truth.step(x, u, now)


@compiled
def _estimated(follower: AbstractFilter, state: FilterState, sample: Sample) -> FilterState:
    return follower.step(state, sample)[0]


@compiled
def _planned(mpc: Mpc, plan: MpcPlan, x: Array, reference: Array, now: Array) -> tuple[MpcPlan, Array, Solved]:
    return mpc.command(plan, x, reference, now)


def _decided(
    mpc: Mpc, follower: AbstractFilter, state: FilterState, plan: MpcPlan, sample: Sample, reference: Array
) -> tuple[FilterState, MpcPlan, Array, Solved]:
    """What one sample takes: the estimate, and the plan from it."""
    after = _estimated(follower, state, sample)
    return after, *_planned(mpc, plan, after.x, reference, sample.inputs.time)


def _assembled(truth: Plant, mpc: Mpc, table: np.ndarray, rows: list[tuple], name: str) -> Pursuit:
    layout = truth.vehicle.layout
    measured, inputs, true, solved, seconds, work = zip(*rows, strict=True)
    times = truth.dt * np.arange(len(rows))
    stacked = jax.tree.map(lambda *leaves: np.stack([np.asarray(leaf) for leaf in leaves]), *solved)
    given = np.stack(inputs)
    if not np.isfinite(given).all() or not stacked.finite.all():
        first = times[int(np.argmax(~stacked.finite))]
        raise InputError(layout.name, f"the prediction ceases to be finite at {first:g} s", "ask less of it")
    columns = recorded_columns(layout.outputs, np.stack(measured))
    signals = np.tile(np.asarray(truth.constants), (len(rows), 1))
    signals[:, list(truth.driven)] = given
    columns |= dict(zip((*layout.held, *layout.interpolated), signals.T, strict=True))
    looked = (*mpc.weights.track, *mpc.weights.bounded)
    kept = {channel: np.array([float(shown[channel]) for shown in true]) for channel in looked}
    recording = Recording(name, times, columns, f"{layout.name}, {name}")
    return Pursuit(recording, kept, table, given, np.array(seconds), np.array(work), stacked)


def _check(truth: Plant, mpc: Mpc, wanted: Mapping[str, np.ndarray]) -> None:
    name = truth.vehicle.layout.name
    for what in ("dt", "inputs", "outputs"):
        if getattr(truth, what) != getattr(mpc.plant, what):
            raise InputError(name, f"the truth and the controller's plant differ in {what}", "discretise both alike")
    lengths = {np.shape(values) for values in wanted.values()}
    if set(wanted) != set(mpc.weights.track) or len(lengths) != 1:
        tracked = ", ".join(mpc.weights.track)
        raise InputError(f"{name}: references", f"the controller tracks {tracked}", "give one of each, of one length")
