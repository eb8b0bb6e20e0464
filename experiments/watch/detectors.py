"""Three detectors on the same runs: the watcher, a fixed threshold of innovations, and the paper's fuzzy rule."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxsub.filter import (
    ConstantNoise,
    Drive,
    ExtendedKalmanFilter,
    FuzzyNoise,
    Sample,
    VehicleProcess,
    state_scale,
)
from jaxsub.filter.defaults import DENSITY
from jaxsub.monitoring import Monitor, Watcher, initial_state
from jaxsub.programs import compiled

from .truth import DT, SIGMA, Runs, vehicle

# s over which the fuzzy rule's density is averaged
_AVERAGED = 10.0
_EQUATIONS = ("surge", "sway", "yaw")
_CHANNELS = ("u", "v", "r", "psi")
PLACES = (*_EQUATIONS, *(f"sensor:{channel}" for channel in _CHANNELS))


class Series(NamedTuple):
    """Of R runs of K samples a statistic (R, K) and the number of the place (R, K) where it is largest.

    `likely` (R, K, P) are the places that it says cannot be told from that.
    """

    statistic: np.ndarray
    place: np.ndarray
    since: np.ndarray | None = None
    likely: np.ndarray | None = None


def watched(watcher: Watcher, runs: Runs) -> Series:
    """The watcher's statistic, place, and the time since when (s)."""
    begun = jnp.stack(
        [watcher.monitor.start(initial_state(watcher.model, own[:16])).stream.filter.x for own in runs.rows]
    )
    found = _watched(watcher.monitor, begun, jnp.asarray(runs.rows))
    statistic, change, age, recovered, likely = map(np.asarray, found)
    jumped = recovered.any(axis=-1)
    place = np.where(jumped, len(_EQUATIONS) + np.argmax(recovered, axis=-1), change)
    # a sensor that is believed again after it jumped is an alarm whatever the statistic
    likely = np.where(np.expand_dims(jumped, -1), np.arange(len(PLACES)) == place[..., None], likely)
    return Series(np.where(jumped, np.inf, statistic), place, runs.rows[..., 0] - DT * age, likely)


@compiled
def _watched(monitor: Monitor, begun, rows):
    def step(state, row):
        after, found = monitor.step(state, row)
        return after, (found.statistic, found.change, found.age, found.recovered, found.likely)

    def run(z, own):
        return jax.lax.scan(step, monitor.start(z[: -len(_EQUATIONS)]), own)[1]

    return jax.vmap(run)(begun, rows)


def by_innovations(runs: Runs, largest: np.ndarray | None = None) -> tuple[Series, np.ndarray]:
    """Innovations of a filter with the default process noise, in its standard deviations, over a limit by channel.

    The limit is the `largest` of each channel in clean runs after a minute; by default of these runs. It comes back.
    """
    scale = state_scale(vehicle(), SIGMA)
    size, _ = _filtered(ConstantNoise(jnp.diag(DENSITY * jnp.asarray(scale))), runs)
    limit = np.asarray(np.max(size[:, round(60.0 / DT) :], axis=(0, 1)) if largest is None else largest)
    ratio = size / limit
    return Series(ratio.max(axis=-1), len(_EQUATIONS) + ratio.argmax(axis=-1)), limit


def by_fuzzy_rule(runs: Runs, usual: np.ndarray | None = None) -> tuple[Series, np.ndarray]:
    """The fuzzy rule's process noise in each equation, averaged, over its `usual` mean, by default that of the runs."""
    scale = jnp.asarray(DENSITY * state_scale(vehicle(), SIGMA))
    _, noise = _filtered(FuzzyNoise(scale, 100.0 * scale), runs)
    width = round(_AVERAGED / DT)
    total = np.cumsum(noise, axis=1)
    mean = np.concatenate([total[:, :width], total[:, width:] - total[:, :-width]], axis=1) / width
    usual = np.asarray(np.mean(mean[:, width:], axis=(0, 1)) if usual is None else usual)
    ratio = mean / usual
    return Series(ratio.max(axis=-1), ratio.argmax(axis=-1)), usual


def _filtered(rule, runs: Runs) -> tuple[np.ndarray, np.ndarray]:
    model = vehicle()
    known = model.holding([row.name for row in model.layout.free])
    scale = jnp.asarray(state_scale(known, SIGMA))
    filter = ExtendedKalmanFilter(VehicleProcess.of(known), rule, jnp.diag(jnp.asarray(SIGMA)), jnp.diag(10.0 * scale))
    starts = jnp.asarray(np.pad(runs.rows[:, 0, 3:], ((0, 0), (0, len(known.layout.states) - 4))))
    found = _over(filter, starts, jnp.asarray(runs.rows))
    return np.asarray(found[0]), np.asarray(found[1])


@compiled
def _over(filter, starts, rows):

    def run(start, own):
        signals = own[:, 1:3]
        before = jnp.concatenate([signals[:1], signals[:-1]])
        held = jnp.stack([jnp.concatenate([before, own[:, :1]], axis=1)] * 3, axis=1)
        elapsed = jnp.concatenate([jnp.zeros(1), jnp.diff(own[:, 0])])
        samples = Sample(Drive(held, own[:, 0], signals), elapsed, own[:, 3:], jnp.ones(own[:, 3:].shape, bool))
        begin = filter.start(start, jnp.zeros(0), jnp.zeros((0, 0)))

        def step(state, sample):
            state, found = filter.step(state, sample)
            white = jnp.abs(found.innovation) / found.innovation_std
            return state, (white, found.noise_std[:3] ** 2)

        return jax.lax.scan(step, begin, samples)[1]

    return jax.vmap(run)(starts, rows)
