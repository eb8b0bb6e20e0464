"""From readings of raw sensors to attitude, velocity and position with standard deviations."""

import dataclasses
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from ..errors import InputError
from ..filter import (
    AbstractFilter,
    ExtendedKalmanFilter,
    FilterState,
    Sample,
    Smoothed,
    last,
    smooth_block,
)
from ..findings import Finding
from ..programs import compiled
from .field import FieldFit, with_field
from .rows import Rows, padded, rows_of
from .start import WIDER, Start, start_of
from .suite import SensorSuite
from .suite.log import SensorLog
from .suite_filter import filter_of
from .track import Shown, Track

# rows of a block: what is compiled once, and what the smoother does again
_BLOCK = 2048
# s by which a start in motion is found, and how often it is smoothed: a filter that begins with a wrong attitude
# linearises about it, and is too sure of the yaw and the delays that it then finds
_ALIGNING, _ROUNDS = 20.0, 3

Progress = Callable[[float, float], object]


@dataclasses.dataclass(frozen=True, eq=False)
class Navigation:
    """What the sensors of a log say of a vehicle's motion.

    **Fields**

    - `suite`, `log`, `rows`, `start`: what it was made of. `filtered`: given the rows so far; `smoothed`: given all.
    - `innovations`: (K, c) over their standard deviations; `used`: (K, c) where measured and believed.
    - `measured`: (K, c) where measured. `channels`: of each sensor, and of what is known beforehand.
    - `findings`: what was wrong with the readings. `field`: of a magnetometer that was to be calibrated or timed.
    - `delays`: names of sensors whose delay is a state, in the order of the states.
    """

    suite: SensorSuite
    log: SensorLog
    rows: Rows
    start: Start
    filtered: Track
    smoothed: Track
    innovations: Float[np.ndarray, "k c"]
    used: Bool[np.ndarray, "k c"]
    measured: Bool[np.ndarray, "k c"]
    channels: dict[str, slice]
    delays: tuple[str, ...]
    findings: tuple[Finding, ...]
    field: FieldFit | None


class _Seen(NamedTuple):
    track: Track
    innovation: Array
    used: Array


def navigate(log: SensorLog, suite: SensorSuite, progress: Progress = lambda done, of: None) -> Navigation:
    """The motion that a log's readings show, filtered and smoothed.

    `progress` is called with the passes over the rows that are done, and all. **Raises** `InputError` for a log without
    inertial readings, and where the filter breaks down.
    """
    log, suite, field = with_field(log, suite)
    rows, start = rows_of(log, suite), start_of(log, suite)
    filter, late, channels = filter_of(log, suite, start)
    arm = jnp.asarray(suite.only("accelerometer").lever_arm)
    x = np.concatenate([start.x, np.zeros(len(late))])
    K, early = len(rows.times), int(np.searchsorted(rows.times, rows.times[0] + _ALIGNING, side="right"))
    rounds = 0 if start.rest or start.heading == "by fixes" else _ROUNDS
    steps = _Steps(progress, _cost(K) * (2 if late else 1) + rounds * _cost(early))
    begin = filter.start(jnp.asarray(x), jnp.zeros(0), jnp.zeros((0, 0)))
    for _ in range(rounds):
        begin = _aligned(filter, _passes(filter, begin, rows, early, arm, steps).first)
    shifts = np.zeros(len(late))
    if late:
        # readings are moved by what a first pass finds: the filter's own delay is linear, and noise makes it too short
        shifts = np.asarray(_passes(filter, begin, rows, K, arm, steps).smoothed.constants)[-1, -len(late) :]
        rows = rows_of(log, _delayed(suite, dict(zip(late, shifts.tolist(), strict=True))))
        begin = dataclasses.replace(begin, x=begin.x.at[-len(late) :].set(0.0))
    found = _passes(filter, begin, rows, K, arm, steps)
    nominal = shifts + np.array([sensor.delay for sensor in suite.aiding if sensor.name in late])
    if found.diverged:
        what = f"the filter's numbers cease to be finite with the sensors of {suite.source}"
        raise InputError(log.source, what, "see whether units, axes and noise are as they are there")
    innovations, used = np.asarray(found.seen.innovation), np.asarray(found.seen.used)
    filtered, smoothed = (_with_delays(track, nominal) for track in (found.seen.track, found.smoothed))
    return Navigation(
        suite, log, rows, start, filtered, smoothed, innovations, used,
        np.asarray(rows.samples.mask), channels, late, (*log.findings, *rows.findings), field,
    )  # fmt: skip


def _delayed(suite: SensorSuite, more: dict[str, float]) -> SensorSuite:
    """The suite with so many seconds more of delay, by sensor's name."""
    sensors = (dataclasses.replace(one, delay=one.delay + more.get(one.name, 0.0)) for one in suite.sensors)
    return dataclasses.replace(suite, sensors=tuple(sensors))


def _with_delays(track: Track, nominal: Float[np.ndarray, " d"]) -> Track:
    """The track whose delays, its last constants, count from zero and not from the `nominal` ones."""
    constants = np.array(track.constants)
    constants[:, constants.shape[1] - len(nominal) :] += nominal
    return dataclasses.replace(track, constants=constants)


class _Found(NamedTuple):
    """What a pass forward and one backward find: of each row, and the smoothed state before the first of them."""

    seen: _Seen
    smoothed: Track
    first: Smoothed
    diverged: bool


def _passes(
    filter: ExtendedKalmanFilter, state: FilterState, rows: Rows, K: int, arm: Float[Array, "3"], steps: "_Steps"
) -> _Found:
    """The filter over the first K rows from a state, block by block, and the smoother back."""
    part = lambda first: padded(rows.samples, first, min(_BLOCK, K - first), _BLOCK)
    begins, seen, smoothed = [], [], []
    for first in range(0, K, _BLOCK):
        begins.append(state)
        state, found = _forward(filter, state, part(first), arm)
        seen.append(jax.tree.map(np.asarray, found))
        steps.done(1)
    after = last(filter, state)
    for begin, first in reversed(list(zip(begins, range(0, K, _BLOCK), strict=True))):
        after, track = smooth_block(filter, begin, part(first), after, Shown(arm))
        smoothed.append(jax.tree.map(np.asarray, track))
        steps.done(2)
    joined = lambda parts: jax.tree.map(lambda *leaves: np.concatenate(leaves)[:K], *parts)
    return _Found(joined(seen), joined(smoothed[::-1]), after, bool(state.diverged))


def _aligned(filter: ExtendedKalmanFilter, first: Smoothed) -> FilterState:
    """A start at what the first seconds say of it, of which a tenth is then counted twice."""
    state = filter.start(first.x, jnp.zeros(0), jnp.zeros((0, 0)))
    root = jnp.linalg.cholesky(WIDER**2 * first.covariance)
    return dataclasses.replace(state, joint=filter.form.start(root))


def _cost(K: int) -> int:
    """Of the passes over K rows, in blocks passed."""
    return 3 * -(-K // _BLOCK)


class _Steps:
    """Counts what is done, and tells of it."""

    def __init__(self, progress: Progress, of: int):
        self._progress, self._of, self._done = progress, of, 0

    def done(self, more: int) -> None:
        """So many more."""
        self._done += more
        self._progress(float(self._done), float(self._of))


@compiled
def _forward(
    filter: AbstractFilter, state: FilterState, samples: Sample, arm: Float[Array, "3"]
) -> tuple[FilterState, _Seen]:
    """The filter over a block, and what is kept of each row."""
    shown = Shown(arm)

    def step(state: FilterState, sample: Sample) -> tuple[FilterState, _Seen]:
        state, estimate = filter.step(state, sample)
        track = shown(last(filter, state), sample)
        return state, _Seen(track, estimate.innovation / estimate.innovation_std, estimate.used)

    return jax.lax.scan(step, state, samples)
