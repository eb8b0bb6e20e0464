r"""What is left of runs that no fit saw: how large it is, whether it is random, and whether it goes with an input.

A model that has all the physics leaves what goes with no input, white or not; sensors' noise alone leaves what is
white as well. Source: Ljung (1999), System Identification, ch. 16.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float
from scipy import special

from ...likelihood.whiteness import portmanteau
from ...recording import Recording
from ...vehicle import Layout
from .. import settings
from ..records.diagnosis import Remainder

_DELAYS = 60  # from one sample to a quarter of the longest run
_STILL = 1e-9  # of its size: what moves less is rounding

# (r, K) samples of runs, zero where there is none
Samples = Float[np.ndarray, "r k"]


def remainders(
    error: Sequence[Float[np.ndarray, "k c"]],
    recordings: Sequence[Recording],
    layout: Layout,
    sigma: Float[np.ndarray, " c"],
) -> dict[str, Remainder]:
    """By channel the simulation `error` of a model on `recordings`, SI, padded to one length.

    Inputs are all that drives the model: actuators, prescribed motions and surroundings.
    """
    signals = (*layout.inputs, *layout.prescribed, *layout.environment)
    moved = {name: stacked_columns([run.column(column) for run in recordings]) for name, column in signals}
    inputs = {name: _about_mean(*one) for name, one in moved.items()}
    inputs = {name: (values, there) for name, (values, there) in inputs.items() if np.any(values)}
    step = float(np.median(np.concatenate([np.diff(run.times) for run in recordings])))
    found = {}
    for i, (channel, column) in enumerate(layout.measured.items()):
        _, measured = stacked_columns([run.column(column) for run in recordings])
        own = np.stack([run[: measured.shape[1], i] / sigma[i] for run in error])
        found[channel] = _remainder(np.where(measured, own, 0.0), measured, inputs, step)
    return found


def beyond_noise(left: dict[str, Remainder], rms: dict[str, float], layout: Layout) -> list[str]:
    """One line: the channels of stated noise whose simulation error is larger than it and correlated."""
    stated = [output.name for output in layout.outputs if output.sigma is not None]
    found = [c for c in stated if left[c].low > 1.0 and left[c].random < settings.RESIDUAL_LEVEL]
    led = lambda one: f", with {one.follows}" if one.independent < settings.RESIDUAL_LEVEL else ""
    channels = ", ".join(f"{c} ({rms[c]:.2g} σ{led(left[c])})" for c in found)
    return [f"Simulation of the test runs leaves more than noise in {channels}."] if found else []


def _remainder(
    residual: Samples,
    measured: Bool[np.ndarray, "r k"],
    inputs: dict[str, tuple[Samples, Bool[np.ndarray, "r k"]]],
    step: float,
) -> Remainder:
    count, span = int(measured.sum()), residual.shape[1] // 4
    later = np.unique(np.geomspace(1, max(span, 1), _DELAYS).round().astype(int))[:span]
    if not count or not np.all(np.isfinite(residual)):
        return Remainder(np.nan, np.nan, count, step * later, np.full(len(later), np.nan), np.nan, {}, None, np.nan)
    low, high = _interval(residual, measured)
    own = correlation(residual, measured, residual, measured, span)[0]
    either = span + np.concatenate([-later[::-1], [0], later])
    errors = {name: _standardised(residual, measured, own, *one)[either] for name, one in inputs.items()}
    most = {name: float(np.max(np.abs(one))) for name, one in errors.items()}
    follows = max(most, key=lambda name: most[name], default=None)
    tried = len(errors) * len(either)
    chance = min(1.0, tried * float(special.erfc(most[follows] / np.sqrt(2.0)))) if follows else 1.0
    random = portmanteau(residual[..., None], measured[..., None])
    return Remainder(low, high, count, step * later, own[span + later], random, errors, follows, chance)


def _interval(residual: Samples, measured: Bool[np.ndarray, "r k"]) -> tuple[float, float]:
    """The ends of the 95 % interval of a residual's rms, by Student's t of its logarithm over blocks of runs.

    Neighbours go together, so it is blocks that are independent. Source: Cochran (1977), Sampling Techniques, ch. 6.
    """
    blocks = lambda of: np.concatenate([part.sum(axis=1) for part in np.array_split(of, settings.BLOCKS, axis=1)])
    squares, counts = blocks(residual**2), blocks(measured)
    squares, counts = squares[counts > 0], counts[counts > 0]
    mean, n = squares.sum() / counts.sum(), len(counts)
    if n < 2 or mean == 0.0:
        return (0.0, 0.0) if mean == 0.0 else (0.0, np.inf)
    error = np.sqrt(n / (n - 1) * np.sum((squares - mean * counts) ** 2)) / counts.sum()
    spread = np.exp(0.5 * special.stdtrit(n - 1, 1.0 - settings.LEVEL / 2.0) * error / mean)
    return float(np.sqrt(mean) / spread), float(np.sqrt(mean) * spread)


def _standardised(
    residual: Samples, measured: np.ndarray, own: np.ndarray, signal: Samples, there: np.ndarray
) -> Float[np.ndarray, " l"]:
    r"""Correlation of a residual with a signal τ samples before it, over its standard error: as many τ as `own` has.

    $N\,\mathrm{var}\,r_\tau = \sum_k \rho_e(k)\rho_u(k)$ where neither goes with the other (Bartlett 1946): what is
    slow agrees with what is slow by chance. Sums are tapered, and never less than of white noise.
    """
    span = len(own) // 2
    alike = own * correlation(signal, there, signal, there, span)[0]
    taper = 1.0 - np.abs(np.arange(-span, span + 1)) / (span + 1.0)
    found, pairs = correlation(residual, measured, signal, there, span)
    return found / np.sqrt(max(float(np.sum(taper * alike)), 1.0) / pairs)


def correlation(
    later: Samples, there: np.ndarray, earlier: Samples, here: np.ndarray, most: int
) -> tuple[Float[np.ndarray, " l"], Float[np.ndarray, " l"]]:
    r"""$\sum a_{k+\tau}b_k / \sqrt{\sum a_{k+\tau}^2\sum b_k^2}$ for τ = −`most` … `most`, and how many pairs each has.

    Over the pairs of all runs (r, K) in which both were measured, `there` and `here`.
    """
    a, b = there.astype(float), here.astype(float)
    pairs = np.maximum(np.round(_lagged(a, b, most)), 1.0)
    energy = _lagged(later**2, b, most) * _lagged(a, earlier**2, most)
    return _lagged(later, earlier, most) / np.sqrt(np.maximum(energy, 1e-300)), pairs


def _lagged(later: np.ndarray, earlier: np.ndarray, most: int) -> Float[np.ndarray, " l"]:
    size = 2 * later.shape[1]
    product = np.fft.rfft(later, size) * np.conj(np.fft.rfft(earlier, size))
    total = np.fft.irfft(product, size).sum(axis=0)
    return total[np.arange(-most, most + 1)]


def stacked_columns(columns: Sequence[np.ndarray]) -> tuple[Samples, Bool[np.ndarray, "r k"]]:
    """Columns of runs made up to one length, and where they have samples."""
    values = np.full((len(columns), max(map(len, columns))), np.nan)
    for row, column in zip(values, columns, strict=True):
        row[: len(column)] = column
    there = np.isfinite(values)
    return np.where(there, values, 0.0), there


def _about_mean(values: Samples, there: Bool[np.ndarray, "r k"]) -> tuple[Samples, Bool[np.ndarray, "r k"]]:
    mean = values.sum(axis=1, keepdims=True) / np.maximum(there.sum(axis=1, keepdims=True), 1)
    moved = np.where(there, values - mean, 0.0)
    return np.where(np.abs(moved) > _STILL * np.max(np.abs(values)), moved, 0.0), there
