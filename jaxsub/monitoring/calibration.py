r"""The threshold of a monitor's test for a rate of false alarms, from clean runs.

Whitened innovations of clean runs are resampled for many hours, by an autoregression of each channel that is driven by
vectors drawn from what it leaves (the sieve bootstrap), and scored with the signatures along those runs. What the
disturbance leaves correlated enters twice: by the autoregressions, and by the variance of each change's z, which is
one for white innovations. Peaks of the statistic over a high level u, one for each alarm that there would be, exceed it
by an exponential amount, as maxima of squared Gaussian scores do:

$\lambda(h) = \lambda_u e^{-(h-u)/\beta}$

so the threshold of a rate λ is $u + \beta\ln(\lambda_u/\lambda)$.

Source: Bühlmann (1997), Bernoulli 3, for the sieve; Davison and Smith (1990), J. R. Statist. Soc. B 52, for peaks.
"""

import dataclasses
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Key

from ..errors import InputError
from ..programs import compiled
from .autoregression import Autoregression
from .monitor import FilteredRow, Monitor, MonitorState
from .signatures import Linearisation, Signatures, squares, window_lengths

# hours of resampled innovations, and how many of them side by side
HOURS, _SIDE_BY_SIDE = 100.0, 25
# samples of them at most: a fast stream is calibrated on fewer hours
_MOST = 8_000_000
# peaks that the tail is fitted to, and the fewest
_PEAKS, _FEWEST = 400, 30
# times the quiet time, of the usual time between two peaks
_APART = 10
# parts of the quiet time in which the largest statistic is kept
_PARTS = 6
# samples along which the filter is linearised
_ALONG = 4096
# windows that a clean run must hold for its own variance to count
_REPEATS = 32


class Tail(NamedTuple):
    """How often alarms are false by threshold: `rate` per hour over the level `level`, falling by `scale`."""

    level: float
    rate: float
    scale: float

    def threshold(self, rate: float) -> float:
        """The threshold with a `rate` of false alarms per hour."""
        return self.level + self.scale * float(np.log(self.rate / rate))

    def rate_of(self, statistic: float) -> float:
        """False alarms per hour whose statistic is at least so large."""
        return self.rate * float(np.exp(-(statistic - self.level) / self.scale))


class Calibration(NamedTuple):
    """A monitor with its threshold.

    **Fields**

    - `monitor`: whose test has the threshold. `tail`: of false alarms.
    """

    monitor: Monitor
    tail: Tail


def calibrated(
    monitor: Monitor,
    state: MonitorState,
    rows: Float[np.ndarray, "k w"],
    rate: float,
    *,
    white: bool = False,
    hours: float = HOURS,
    seed: int = 0,
) -> Calibration:
    """`monitor` with the threshold that gives `rate` false alarms per hour, by the clean `rows` (K, w).

    `state` is that before the first of them. So many `hours` are resampled, by the random `seed`, or fewer of a stream
    that is fast. Where innovations are `white`, as the monitor assumes, the rows say only how the vehicle moves.

    **Raises** `InputError` for rows whose innovations are too few or not finite.
    """
    met, own = (jax.tree.map(np.asarray, part) for part in _followed(monitor, state, jnp.asarray(rows)))
    taken = met.taken & ~met.fresh
    if taken.sum() < _FEWEST:
        raise InputError("clean runs", f"have {taken.sum()} usable samples", f"give at least {_FEWEST}")
    interval = float(np.median(np.diff(rows[taken, 0])))
    model = Autoregression.white(monitor.sigma.size) if white else Autoregression.of(met.white[taken])
    own = np.ones_like(own) if white else own
    return _with_threshold(monitor, met, model, interval, rate, hours, seed, own)


def _with_threshold(
    monitor: Monitor,
    met: FilteredRow,
    model: Autoregression,
    interval: float,
    rate: float,
    hours: float,
    seed: int,
    own: Float[np.ndarray, "m q"],
) -> Calibration:
    hours = min(hours, _MOST * interval / 3600.0)
    part = max(1, round(float(monitor.test.quiet) / _PARTS / interval))
    parts = int(np.ceil(hours * 3600.0 / (_SIDE_BY_SIDE * part * interval)))
    usable = np.flatnonzero(met.taken)[:_ALONG]
    along = jax.tree.map(lambda leaf: jnp.asarray(leaf[usable]), met.at)
    windows, key = len(monitor.test.variance), jax.random.key(seed)
    shape = (parts, part, _SIDE_BY_SIDE)
    largest, mean = _resampled(along, model, key, monitor.sigma, windows, shape)
    variance = np.maximum(np.maximum(1.0, mean), _significant(own, int(met.taken.sum())))
    series = np.max(np.asarray(largest) / variance, axis=(2, 3)).T
    tail = tail_of(series, part * interval, rate)
    test = dataclasses.replace(
        monitor.test, threshold=jnp.asarray(tail.threshold(rate)), variance=jnp.asarray(variance)
    )
    return Calibration(dataclasses.replace(monitor, test=test), tail)


def _significant(own: Float[np.ndarray, "m q"], samples: int) -> Float[np.ndarray, "m q"]:
    """Variances of z on the clean runs themselves where these have enough windows to tell them from one."""
    repeats = samples / window_lengths(len(own))[:, None]
    return np.where((repeats >= _REPEATS) & (own > 1.0 + 2.0 * np.sqrt(2.0 / np.maximum(repeats, 1.0))), own, 1.0)


@compiled
def _followed(
    monitor: Monitor, state: MonitorState, rows: Float[Array, "k w"]
) -> tuple[FilteredRow, Float[Array, "m q"]]:
    """The rows as the monitor's filter meets them, and the mean of z² of each change in each window."""
    one = jnp.ones_like(monitor.test.variance)

    def step(carry: tuple[MonitorState, Array], row: Array) -> tuple[tuple[MonitorState, Array], FilteredRow]:
        state, total = carry
        after, met, _ = monitor.examined(state, row)
        z2 = squares(after.score, after.signatures.information, one)
        return (after, total + jnp.where(met.taken, z2, 0.0)), met

    (_, total), met = jax.lax.scan(step, (state, jnp.zeros_like(one)), rows)
    return met, total / jnp.maximum(jnp.sum(met.taken), 1)


@compiled
def _resampled(
    along: Linearisation,
    model: Autoregression,
    key: Key[Array, ""],
    sigma: Float[Array, " c"],
    windows: int,
    shape: tuple[int, int, int],
) -> tuple[Float[Array, "parts b m q"], Float[Array, "m q"]]:
    """The largest z² of each change in each window in every part, b series side by side, and the mean of z².

    `shape` is how many parts there are, of how many samples, in how many series.
    """
    (parts, part, b), length, z = shape, along.F.shape[0], along.F.shape[-1]
    q = along.force.shape[-1] + sigma.size
    one = jnp.ones((windows, q))

    def step(carry: tuple, _: None) -> tuple[tuple, None]:
        k, past, signatures, score, largest, total = carry
        at = jax.tree.map(lambda leaf: leaf[k % length], along)
        after, signs, fresh = signatures.after(at, sigma)
        past, e = model.next(past, jax.random.fold_in(key, k))
        added = (e @ jnp.moveaxis(signs, 1, 0).reshape(sigma.size, -1)).reshape(b, windows, q)
        score = jnp.where(fresh[:, None], 0.0, score) + added
        z2 = squares(score, after.information, one)
        return (k + 1, past, after, score, jnp.maximum(largest, z2), total + jnp.mean(z2, axis=0)), None

    def of_part(carry: tuple, _: None) -> tuple[tuple, Array]:
        *state, score, total = carry
        begun = (*state, score, jnp.zeros_like(score), total)
        (*state, score, largest, total), _ = jax.lax.scan(step, begun, None, length=part)
        return (*state, score, total), largest.astype(jnp.float32)

    begun = jnp.asarray(0), model.start(b), Signatures.start(windows, z, q), jnp.zeros((b, windows, q)), one * 0.0
    (k, *_, total), largest = jax.lax.scan(of_part, begun, None, length=parts)
    return largest, total / k


def peaks(series: Float[np.ndarray, "b parts"], level: float, quiet: int) -> Float[np.ndarray, " p"]:
    """The peak of each alarm in the `series` at a threshold `level`; one has ended after `quiet` parts below it."""
    found = []
    for one in series:
        above = np.flatnonzero(one > level)
        if above.size:
            episodes = np.split(above, np.flatnonzero(np.diff(above) > quiet) + 1)
            found += [float(np.max(one[part])) for part in episodes]
    return np.array(found)


def tail_of(series: Float[np.ndarray, "b parts"], duration: float, rate: float) -> Tail:
    """The tail of alarms in the statistic's `series` (B, parts), its largest in each part of `duration` s.

    The level is as high as leaves enough peaks to fit, or twice those of the `rate` per hour that is asked for.
    """
    hours = series.size * duration / 3600.0
    # at a low level alarms run into each other, and the peak of many is no peak of one
    wanted = min(max(min(_PEAKS, series.size / (_APART * _PARTS)), 2.0 * rate * hours), 0.2 * series.size)
    # counts fall with the level once that is above the bulk
    low, high = float(np.median(series)), float(series.max())
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if len(peaks(series, middle, _PARTS)) > wanted else (low, middle)
    found = peaks(series, low, _PARTS)
    return Tail(low, len(found) / hours, float(np.mean(found - low)))
