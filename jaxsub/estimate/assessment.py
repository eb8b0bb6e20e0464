r"""Whether a model explains runs: tests of the size, the whiteness and the spikes of its whitened residuals.

Size: with $\bar e^2$ the mean square of a channel's residuals in its σ and $N_e = N / (1 + 2\sum_l \rho_l^2)$ its
effective samples (Bartlett 1946), $N_e \bar e^2$ is $\chi^2$ of $N_e$ degrees of freedom, less what the fit took.
Whiteness: the portmanteau test. Spikes: the largest residual against that of N Gaussian ones. A test rejects only where
its p-value is below `LEVEL` and the departure matters; over channels, p-values are corrected for their number.
"""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Bool, Float
from scipy import special

from ..findings import Finding
from ..likelihood import output_errors
from ..likelihood.whiteness import portmanteau_by_channel, predicted_share
from ..plain import plain
from .fitting import AbstractSearchEnd, Solution

# probability of a false alarm of each test
LEVEL = 0.01
# departures that matter: rms in σ, since a file's σ is a rounded number; and the variance that the past predicts, or
# that lies in spikes, in units of the noise's
_RMS, _PREDICTED, _SPIKED = 1.1, 0.1, 0.1
# from this many of the bulk's standard deviations on a residual is a spike
_SPIKE = 6.0
# lags of the autocorrelation that effective samples allow for
_LAGS = 60
# of the median absolute deviation, the standard deviation of a Gaussian
_GAUSSIAN = 1.4826
_NAMED = 4
RIGHT_MODEL = "standard errors below hold only for a right model; try `jaxsub diagnose`"


@dataclasses.dataclass(frozen=True)
class ChannelResidual:
    """What a model leaves of one channel.

    **Fields**

    - `channel`: its name. `samples`: how many were measured; `effective`: how many independent ones these count for.
    - `rms`: of the residual, in σ; None where it is not finite. `known`: whether σ was given and not estimated from
      these residuals, so that their size can be tested.
    - `size`, `white`, `spikes`: p-values of the tests; None where a test does not apply.
    - `predicted`: share of the variance that the residual's past predicts. `spiked`: share that lies in spikes.
    - `largest`: the largest residual, in standard deviations of the bulk of them; None where it is not finite.
    """

    channel: str
    samples: int
    effective: float
    rms: float | None
    known: bool
    size: float | None
    white: float | None
    spikes: float | None
    predicted: float
    spiked: float
    largest: float | None


@dataclasses.dataclass(frozen=True)
class Assessment:
    """Whether a model explains runs.

    **Fields**

    - `channels`: what is left of each that was measured.
    - `level`: significance level of each test, after correction for the number of channels.
    """

    channels: tuple[ChannelResidual, ...]
    level: float = LEVEL

    @property
    def size(self) -> float | None:
        """p-value of the test of size over all channels; None where no channel has a known σ."""
        return _least([channel.size for channel in self.channels])

    @property
    def white(self) -> float | None:
        """p-value of the test of whiteness over all channels; None where there are too few samples."""
        return _least([channel.white for channel in self.channels])

    @property
    def spikes(self) -> float | None:
        """p-value of the test of spikes over all channels."""
        return _least([channel.spikes for channel in self.channels])

    @property
    def runs_model(self) -> bool:
        """Whether the model runs: all residuals are finite."""
        return all(channel.rms is not None for channel in self.channels)

    @property
    def oversized(self) -> list[ChannelResidual]:
        """Channels whose residual is larger than their σ, the largest first."""
        found = [c for c in self.channels if c.known and self._rejected(c.size, c.rms or np.inf, _RMS)]
        return sorted(found, key=lambda channel: -(channel.rms or np.inf))

    @property
    def coloured(self) -> list[ChannelResidual]:
        """Channels whose residual is not white, the most predictable first."""
        found = [c for c in self.channels if self._rejected_share(c, c.white, c.predicted, _PREDICTED)]
        return sorted(found, key=lambda channel: -channel.predicted)

    @property
    def spiky(self) -> list[ChannelResidual]:
        """Channels much of whose residual lies in a few samples, the largest spike first."""
        found = [c for c in self.channels if self._rejected_share(c, c.spikes, c.spiked, _SPIKED)]
        return sorted(found, key=lambda channel: -(channel.largest or np.inf))

    @property
    def explains(self) -> bool:
        """Whether no test rejects the model."""
        return bool(self.channels) and self.runs_model and not (self.oversized or self.coloured or self.spiky)

    def verdict(self) -> str:
        """The assessment in one sentence."""
        if not self.channels:
            return "explains nothing: these runs measure no output"
        if not self.runs_model:
            return "does not explain these runs: the model does not run from these values"
        return self._accepted() if self.explains else f"does not explain these runs: {self.reason()}; {RIGHT_MODEL}"

    def reason(self) -> str:
        """Which channels the model leaves too much of, and how much; empty where it explains the runs."""
        parts = [", ".join(f"{c.channel} {_number(c.rms)} σ" for c in self.oversized[:_NAMED])]
        others = lambda found: [c for c in found if c not in self.oversized][:_NAMED]
        parts += [f"residuals of {c.channel} are {c.predicted:.0%} predictable" for c in others(self.coloured)]
        parts += [f"{c.channel} has spikes of {_number(c.largest)} σ" for c in others(self.spiky)]
        return ", ".join(part for part in parts if part)

    def findings(self, where: str) -> list[Finding]:
        """A warning of `where`, a file, unless the model explains the runs."""
        if self.explains:
            return []
        what, _, remedy = self.verdict().partition("; ")
        return [Finding("unexplained-runs", "warning", where, what, remedy)]

    def to_json(self) -> dict[str, Any]:
        """The assessment as JSON has it."""
        found = dataclasses.asdict(self)
        tests = {"size": self.size, "whiteness": self.white, "spikes": self.spikes}
        return plain({"explains": self.explains, "verdict": self.verdict(), "p_values": tests} | found)

    def _rejected_share(self, channel: ChannelResidual, p_value: float | None, share: float, matters: float) -> bool:
        # beside a σ that is known, what is small against it does not matter: rounding in runs without noise
        noise = (channel.rms or 0.0) ** 2 if channel.known else 1.0
        return self._rejected(p_value, share * noise, matters)

    def _rejected(self, p_value: float | None, departure: float, matters: float) -> bool:
        return p_value is not None and p_value < self.level / len(self.channels) and departure > matters

    def _accepted(self) -> str:
        known = [c for c in self.channels if c.known]
        size = "no σ is given to judge size by"
        if known:
            largest = max(known, key=lambda channel: channel.rms or 0.0)
            size = f"largest rms {largest.channel} {_number(largest.rms)} σ"
        colour = "too few samples to test whiteness" if self.white is None else "residuals are white"
        predicted = [c for c in self.channels if self._rejected(c.white, c.predicted, 0.0)]
        if predicted:
            most = max(predicted, key=lambda channel: channel.predicted)
            colour = f"residuals of {most.channel} are slightly coloured ({most.predicted:.0%} predictable)"
        return f"explains these runs: {size}; {colour}"


def assess(found: AbstractSearchEnd) -> Assessment:
    """Whether the fit `found` explains its runs; σ that the vehicle leaves open has no test of size."""
    vehicle, runs = found.vehicle, found.runs
    error = found.model.error if isinstance(found, Solution) else output_errors(vehicle, runs, found.start)
    known = [output.sigma is not None for output in vehicle.layout.outputs]
    fitted = len(found.names) + (0 if found.known_start else found.start.size)
    return assess_residuals(
        vehicle.layout.channels, np.asarray(error) / np.asarray(found.sigma), np.asarray(runs.mask), fitted, known
    )


def assess_residuals(
    channels: Sequence[str],
    residual: Float[np.ndarray, "r k c"],
    mask: Bool[np.ndarray, "r k c"],
    fitted: int = 0,
    known: Sequence[bool] | None = None,
) -> Assessment:
    """Whether whitened residuals, in σ, are as noise would leave them.

    `channels` are the names of those of `residual` (R, K, c) and `mask` says where they were measured. `fitted` counts
    the numbers that were fitted to them, initial states included. `known` says whose σ was given and not estimated from
    them: all where it is None.
    """
    known = [True] * len(channels) if known is None else known
    measured = [c for c in range(len(channels)) if mask[..., c].any()]
    share = fitted / max(int(mask.sum()), 1)
    return Assessment(tuple(_channel(channels[c], residual[..., c], mask[..., c], share, known[c]) for c in measured))


def _channel(name: str, residual: np.ndarray, mask: np.ndarray, fitted: float, known: bool) -> ChannelResidual:
    """The tests of one channel (R, K), of which the fit took the share `fitted` of the degrees of freedom."""
    seen, count = residual[mask], int(mask.sum())
    with np.errstate(over="ignore"):
        square = float(np.mean(seen**2))
    if not np.isfinite(square):
        return ChannelResidual(name, count, float(count), None, known, None, None, None, 0.0, 0.0, None)
    rms = float(np.sqrt(square))
    effective = float(_effective(residual, mask))
    freedom = max(effective * (1.0 - fitted), 1e-3)
    size = float(special.chdtrc(freedom, effective * square)) if known else None
    # whiteness does not depend on scale, and huge residuals would overflow
    scaled = (residual / (rms or 1.0))[..., None]
    too_short = residual.shape[1] < 20 or not rms
    white = None if too_short else float(portmanteau_by_channel(scaled, mask[..., None])[0])
    predicted = 0.0 if too_short else max(0.0, float(predicted_share(scaled, mask[..., None])[0]) - 20.0 / count)
    away = np.abs(seen)
    bulk = _GAUSSIAN * float(np.median(away))
    # a residual whose bulk is zero has no scale to judge spikes by
    largest = float(away.max() / bulk) if bulk > 0.0 else None
    spikes = None if largest is None else float(-np.expm1(count * np.log1p(-2.0 * special.ndtr(-largest))))
    spiked = float(np.sum(away[away > _SPIKE * bulk] ** 2) / (count * square)) if largest else 0.0
    return ChannelResidual(name, count, effective, rms, known, size, white, spikes, predicted, spiked, largest)


def _effective(residual: np.ndarray, mask: np.ndarray) -> float:
    """How many independent squares the squares of a channel's residual (R, K) count for."""
    rms = np.sqrt(np.mean(residual[mask] ** 2)) or 1.0
    seen = np.where(mask, residual / rms, 0.0)
    whole, total = float(np.sum(seen**2)), 1.0
    for lag in range(1, min(_LAGS, seen.shape[1] // 4) + 1):
        correlation = float(np.sum(seen[:, lag:] * seen[:, :-lag])) / (whole or 1.0)
        # less what chance alone makes of it
        total += 2.0 * max(0.0, correlation**2 - 1.0 / mask.sum())
    return float(mask.sum()) / total


def _least(p_values: list[float | None]) -> float | None:
    """The least of the p-values, corrected for their number; None where there is none."""
    there = [p for p in p_values if p is not None]
    return min(1.0, min(there) * len(there)) if there else None


def _number(value: float | None) -> str:
    """A number of standard deviations for a sentence: three digits, no trailing zeros."""
    return "unknown" if value is None else f"{value:.3g}"
