"""What fits and recordings are worth: coefficients before and after, correlated estimates, channels and runs."""

from collections.abc import Sequence

import numpy as np

from ...effects import AbstractEffect, RunVariation
from ...estimate import Solution
from ...information.directions import FRACTION
from ...recording import Recording
from ..linearise.whiteness import record_sigma
from ..records.diagnosis import ChannelQuality, Coefficient, ParameterEstimate, RunQuality

# correlation of two estimates from which it is reported
_CLOSE = 0.9
# standard error over a coefficient's size from which it is not excited
_NOT_EXCITED = 5.0


def coefficients(start: dict[str, float], baseline: Solution, improved: Solution) -> list[Coefficient]:
    """Every free number before and after, those that an effect replaced at the end."""
    rows = []
    for name in improved.names:
        before = _estimate(baseline, name)
        after = _estimate(improved, name)
        assert after is not None
        rows.append(Coefficient(name, after.unit, start.get(name, 0.0), before, after, _verdict(after)))
    for name in replaced(baseline, improved):
        before = _estimate(baseline, name)
        assert before is not None
        zero = ParameterEstimate(0.0, 0.0, before.unit)
        rows.append(Coefficient(name, before.unit, start.get(name, 0.0), before, zero, "replaced"))
    return rows


def replaced(baseline: Solution, improved: Solution) -> list[str]:
    """The free numbers of the baseline that are not free in the improved model: effects are in their place."""
    return [name for name in baseline.names if name not in improved.names]


def _estimate(fit: Solution, name: str) -> ParameterEstimate | None:
    if name not in fit.names:
        return None
    unit = next(row.unit for row in fit.vehicle.layout.free if row.name == name)
    return ParameterEstimate(fit.values[name], fit.standard_errors[name], unit)


def estimates(fit: Solution, effect: AbstractEffect) -> dict[str, ParameterEstimate]:
    """The fitted numbers of one effect by symbol."""
    if isinstance(effect, RunVariation):
        (own,) = (one for one in fit.varying([effect.number]) if one.name == effect.number)
        return {"spread": ParameterEstimate(own.spread, own.spread_error or 0.0, own.unit)}
    found = {symbol: _estimate(fit, f"{effect.label}.{symbol}") for symbol in effect.symbols().values()}
    return {symbol: estimate for symbol, estimate in found.items() if estimate is not None}


def trades(fit: Solution, label: str) -> dict[str, float]:
    """The parameters whose estimates are correlated with those of one effect by 0.9 and more.

    The strongest first; an effect's own among each other are its shape, and not listed.
    """
    own = [name.startswith(f"{label}.") for name in fit.names]
    covariance = np.asarray(fit.covariance)
    size = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    between = (covariance / size[:, None] / size)[own]
    if not between.size:
        return {}
    worst = between[np.argmax(np.abs(between), axis=0), np.arange(len(own))]
    found = {n: float(r) for n, r, mine in zip(fit.names, worst, own, strict=True) if not mine and abs(r) >= _CLOSE}
    return dict(sorted(found.items(), key=lambda item: -abs(item[1])))


def _verdict(estimate: ParameterEstimate) -> str:
    ratio = estimate.standard_error / max(abs(estimate.value), 1e-300)
    return "identified" if ratio < FRACTION else "weak" if ratio < _NOT_EXCITED else "not excited"


def channel_quality(fit: Solution) -> list[ChannelQuality]:
    """Samples and noise of each measured channel of the training runs."""
    mask, error, stated = np.asarray(fit.runs.mask), np.asarray(fit.model.error), np.asarray(fit.sigma)
    white = record_sigma(error, mask)
    live = 1 + np.asarray(fit.runs.live).sum(1)
    rows = []
    for i, output in enumerate(fit.vehicle.layout.outputs):
        samples = int(mask[..., i].sum())
        unit = fit.vehicle.layout.unit(output.name)
        missing = 1.0 - samples / live.sum()
        sigma = float(stated[i])
        rows.append(ChannelQuality(output.name, unit, samples, missing, sigma, output.sigma is None, float(white[i])))
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
