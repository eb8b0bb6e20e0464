"""What the improvement is worth on runs that the fit never saw, and what the recordings are worth."""

import dataclasses
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..estimate import Fit, channel_rms, initial_guess, predict, search
from ..likelihood import Disturbance, Followed, follow, residual_outputs, whitened
from ..recording import Recording
from ..recording.runs import Runs
from ..vehicle import AbstractVehicle
from .diagnosis import ChannelQuality, Coefficient, Estimate, Overlay, RunQuality
from .whiteness import record_sigma

_WEAK, _OPEN = 0.5, 5.0
# correlation of two numbers from which on they are told together and hardly apart
_TRADES = 0.9
_TINY = 1e-300
_BLOCKS, _DRAWS = 24, 1999
# of a free run, whose errors go together for longer
LONG_BLOCKS = 4
# a free run's χ² may grow so much by chance
_WORSE = 1.05
_CHANCE = 0.05


@dataclasses.dataclass(frozen=True)
class HeldOut:
    """A vehicle's free run through runs that its fit did not see: only their initial states were found.

    `predicted` and `error` are lists of (K, c) arrays in SI, a run each; `rms` is rms(error)/σ by channel.
    `expected` are (K,) log likelihoods of each sample given those before it, a run each; `squares` (K,) the squared
    errors/σ of each, a run each. Each run is begun anew in each of its `pieces`.
    """

    predicted: list[np.ndarray]
    error: list[np.ndarray]
    rms: dict[str, float]
    expected: list[np.ndarray]
    squares: list[np.ndarray]
    pieces: int = 1


def hold(
    vehicle: AbstractVehicle,
    runs: Runs,
    chosen: Sequence[int],
    size: int,
    sigma: Array,
    disturbance: Disturbance,
    pieces: int = 1,
) -> HeldOut:
    """`vehicle` on the runs numbered `chosen`, in batches of `size`, the size of the training batch.

    In several `pieces` each free run is begun anew at each of them, from the state that a filter has there.
    """
    predicted, errors, expected = [], [], []
    for count, taken in _batches(runs, chosen, size):
        start, spread = initial_guess(vehicle, taken)
        if pieces == 1:
            start = search(vehicle, taken, sigma=sigma, moving=False).start
        followed = follow(vehicle, taken, sigma, disturbance, start, spread)
        shown = predict(vehicle, taken, start) if pieces == 1 else begun_anew(vehicle, followed, taken, pieces)
        predicted += list(np.asarray(shown)[:count])
        errors += list(np.asarray(residual_outputs(vehicle, taken, shown))[:count])
        expected += list(np.asarray(_probable(disturbance, followed))[:count])
    whitened_error = np.stack(errors) / np.asarray(sigma)
    rms = channel_rms(jnp.asarray(whitened_error), runs.take(list(chosen), len(chosen)), vehicle.layout.channels)
    squares = np.sum(whitened_error**2, axis=-1)
    squares = list(np.where(np.isnan(squares), np.inf, squares))
    return HeldOut(predicted, errors, rms, _possible(expected), squares, pieces)


def expects(
    vehicle: AbstractVehicle, runs: Runs, chosen: Sequence[int], size: int, sigma: Array, disturbance: Disturbance
) -> list[np.ndarray]:
    """`HeldOut.expected` of `hold` alone, from initial states of which only the first samples tell."""
    found = []
    for count, taken in _batches(runs, chosen, size):
        followed = follow(vehicle, taken, sigma, disturbance, *initial_guess(vehicle, taken))
        found += list(np.asarray(_probable(disturbance, followed))[:count])
    return _possible(found)


def begun_anew(vehicle: AbstractVehicle, followed: Followed, runs: Runs, pieces: int) -> Float[Array, "r k c"]:
    """Outputs of free runs through `pieces` of each run, each from the filtered state at its first sample."""
    cut, first = runs.segments(pieces), starts(followed, pieces)
    shown = predict(vehicle, cut, first).reshape(len(runs.times), pieces, *cut.outputs.shape[1:])
    inner = shown[:, :, :-1].reshape(len(runs.times), -1, shown.shape[-1])
    return jnp.concatenate([inner, shown[:, -1, -1:]], axis=1)[:, : runs.times.shape[1]]


def starts(followed: Followed, pieces: int) -> Float[Array, "rp s"]:
    """The filtered states where the pieces of runs begin, as `Runs.segments` lists them."""
    samples = followed.filtered.shape[1]
    length = -(-(samples - 1) // pieces)
    first = np.minimum(length * np.arange(pieces), samples - 1)
    return followed.filtered[:, first].reshape(-1, followed.filtered.shape[-1])


def _batches(runs: Runs, chosen: Sequence[int], size: int) -> Iterator[tuple[int, Runs]]:
    """Runs filled up to `size`, and how many of them count."""
    for first in range(0, len(chosen), size):
        batch = list(chosen[first : first + size])
        yield len(batch), runs.take(batch, size)


def _possible(expected: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Where a run diverges nothing is expected."""
    return [np.where(np.isnan(run), -np.inf, run) for run in expected]


@eqx.filter_jit
def _probable(disturbance: Disturbance, followed: Followed) -> Float[Array, "r k"]:
    """How probable each sample is given those before it, as a logarithm."""
    white, factor = whitened(disturbance, followed.system, followed.residual)
    logarithm = jnp.sum(jnp.log(jnp.diagonal(factor, axis1=-2, axis2=-1)), axis=-1)
    return -logarithm - 0.5 * jnp.sum(white[..., 0] ** 2, axis=-1)


class Luck(NamedTuple):
    """What held-out runs gain.

    **Fields**

    - `likelihood`: in log likelihood, each sample given those before it. `probability`: that this is luck.
    - `free`: the ratio of a free run's χ², after to before; `free_probability`: that its fall is luck.
    - `sound`: whether physics admits the numbers of the fit. `freely`: whether it was a free run that asked.
    """

    likelihood: float
    probability: float
    free: float
    free_probability: float
    sound: bool
    freely: bool

    @property
    def helps(self) -> bool:
        """Whether what comes next is predicted better, soundly and not by luck, and a free run not worse.

        Where a free run asked, whether free runs err less, soundly and not by luck: what comes next is told by what
        happens within a few samples.
        """
        if self.freely:
            return self.sound and self.free_probability < _CHANCE
        return self.sound and self.likelihood > 0.0 and self.probability < _CHANCE and self.free < _WORSE


def luck(before: HeldOut, after: HeldOut, sound: bool, *, freely: bool) -> Luck:
    """The gain of held-out runs by a fit that is `sound` or not, of what a free run asked for or not.

    What a free run errs goes together for long, but for no longer than until it is begun anew.
    """
    likelihood, probability = _gained(after.expected, before.expected, _BLOCKS)
    _, free_probability = _gained(before.squares, after.squares, max(LONG_BLOCKS, after.pieces))
    total = lambda held: float(sum(squares.sum() for squares in held.squares))
    free = total(after) / max(total(before), 1e-300)
    return Luck(likelihood, probability, free, free_probability, sound, freely)


def _gained(more: Sequence[np.ndarray], less: Sequence[np.ndarray], count: int) -> tuple[float, float]:
    """The sum of differences of samples (K,) of every run, and the probability that it is above zero by luck.

    By a bootstrap over blocks of samples (Künsch 1989, Ann. Statist. 17), `count` a run: neighbours go together. What
    is no number, for both diverge or each somewhere, is not above zero.
    """
    rng = np.random.default_rng(0)
    with np.errstate(invalid="ignore"):
        blocks = block_gains(more, less, count)
        drawn = rng.choice(blocks, (_DRAWS, len(blocks))).sum(axis=1)
        return float(blocks.sum()), float((1 + np.sum(~(drawn > 0.0))) / (1 + _DRAWS))


def block_gains(more: Sequence[np.ndarray], less: Sequence[np.ndarray], count: int = _BLOCKS) -> np.ndarray:
    """Differences of samples (K,) of every run, their sum over each of `count` blocks of it."""
    gains = [a - b for a, b in zip(more, less, strict=True)]
    return np.concatenate([[part.sum() for part in np.array_split(gain, count)] for gain in gains])


def overlays(
    recordings: Sequence[Recording], channels: tuple[str, ...], baseline: HeldOut, improved: HeldOut
) -> list[Overlay]:
    """Measured and modelled outputs of the held-out runs."""
    drawn = []
    for recording, before, after in zip(recordings, baseline.predicted, improved.predicted, strict=True):
        k = len(recording.times)
        named = lambda table, k=k: {c: table[:k, i] for i, c in enumerate(channels)}
        measured = {c: recording.column(c) for c in channels}
        drawn.append(Overlay(recording.name, recording.times, measured, named(before), named(after)))
    return drawn


def coefficients(start: dict[str, float], baseline: Fit, improved: Fit) -> list[Coefficient]:
    """Every free number before and after."""
    rows = []
    for name in improved.names:
        before = _estimate(baseline, name)
        after = _estimate(improved, name)
        assert after is not None
        rows.append(Coefficient(name, after.unit, start.get(name, 0.0), before, after, _verdict(after)))
    return rows


def _estimate(fit: Fit, name: str) -> Estimate | None:
    if name not in fit.names:
        return None
    unit = next(row.unit for row in fit.vehicle.layout.free if row.name == name)
    return Estimate(fit.values[name], fit.standard_errors[name], unit)


def estimates(fit: Fit, label: str, symbols: dict[str, str]) -> dict[str, Estimate]:
    """The fitted numbers of one effect by symbol."""
    found = {symbol: _estimate(fit, f"{label}.{symbol}") for symbol in symbols.values()}
    return {symbol: estimate for symbol, estimate in found.items() if estimate is not None}


def trades(fit: Fit, label: str) -> dict[str, float]:
    """The numbers that a fit hardly tells apart from those of one effect, with their correlation: of 0.9 and more.

    The strongest first; an effect's own among each other are its shape, and not listed.
    """
    own = [name.startswith(f"{label}.") for name in fit.names]
    covariance = np.asarray(fit.covariance)
    size = np.sqrt(np.maximum(np.diag(covariance), _TINY))
    between = (covariance / size[:, None] / size)[own]
    if not between.size:
        return {}
    worst = between[np.argmax(np.abs(between), axis=0), np.arange(len(own))]
    found = {n: float(r) for n, r, mine in zip(fit.names, worst, own, strict=True) if not mine and abs(r) >= _TRADES}
    return dict(sorted(found.items(), key=lambda item: -abs(item[1])))


def _verdict(estimate: Estimate) -> str:
    ratio = estimate.standard_error / max(abs(estimate.value), 1e-300)
    return "identified" if ratio < _WEAK else "weak" if ratio < _OPEN else "not excited"


def channel_quality(fit: Fit) -> list[ChannelQuality]:
    """Samples and noise of each measured channel of the training runs."""
    mask, error = np.asarray(fit.runs.mask), np.asarray(fit.model.error)
    white = record_sigma(error, mask)
    live = 1 + np.asarray(fit.runs.live).sum(1)
    rows = []
    for i, output in enumerate(fit.vehicle.layout.outputs):
        samples = int(mask[..., i].sum())
        unit = fit.vehicle.layout.unit(output.channel)
        missing = 1.0 - samples / live.sum()
        sigma = float(fit.sigma[i])
        rows.append(
            ChannelQuality(output.channel, unit, samples, missing, sigma, output.sigma is None, float(white[i]))
        )
    return rows


def run_quality(recordings: Sequence[Recording], role: str) -> list[RunQuality]:
    """Length and sampling of runs."""
    rows = []
    for recording in recordings:
        dt = np.diff(recording.times)
        rows.append(
            RunQuality(recording.name, role, recording.duration, len(dt) + 1, float(np.median(dt)), float(dt.max()))
        )
    return rows
