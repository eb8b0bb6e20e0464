"""Whether a filter's innovations are as large as it says, and white: one sensor at a time."""

from typing import NamedTuple

import numpy as np
from scipy.stats import chi2, norm

from .navigate import Navigation

_LEVEL = 0.95


class SensorConsistency(NamedTuple):
    """The innovations of a sensor, each over its standard deviation.

    **Fields**

    - `measurements`: how many there are; `rejected`: outside the gate.
    - `nis`: mean of the squared innovation a channel, with `low` and `high` the 95 % band of a consistent filter.
    - `correlation`: of an innovation with the one before, mean of the channels, with `bound` the 95 % bound of noise.
    """

    name: str
    measurements: int
    rejected: int
    nis: float
    low: float
    high: float
    correlation: float
    bound: float

    @property
    def verdict(self) -> str:
        """What the band says, in words."""
        if not self.measurements - self.rejected:
            return "no measurement was used"
        if self.nis > self.high:
            return "innovations larger than stated"
        return "innovations smaller than stated" if self.nis < self.low else "consistent"


def consistency(found: Navigation) -> list[SensorConsistency]:
    """Each sensor's innovations against what the filter expected of them."""
    names = {sensor.name for sensor in found.suite.aiding}
    return [_of(found, name, block) for name, block in found.channels.items() if name in names]


def _of(found: Navigation, name: str, block: slice) -> SensorConsistency:
    innovations, used, measured = found.innovations[:, block], found.used[:, block], found.measured[:, block]
    values = innovations[used]
    count = max(values.size, 1)
    low, high = (float(chi2.ppf(p, count)) / count for p in (0.5 - 0.5 * _LEVEL, 0.5 + 0.5 * _LEVEL))
    pairs = [_lag_one(column[there]) for column, there in zip(innovations.T, used.T, strict=True)]
    measurements = int(measured.any(axis=1).sum())
    return SensorConsistency(
        name, measurements, int((measured & ~used).any(axis=1).sum()),
        float(np.mean(values**2)) if values.size else np.nan, low, high,
        float(np.mean(pairs)), float(norm.ppf(0.5 + 0.5 * _LEVEL)) / np.sqrt(count),
    )  # fmt: skip


def _lag_one(values: np.ndarray) -> float:
    """The correlation of neighbours, NaN for fewer than three."""
    if len(values) < 3 or not np.any(values):
        return np.nan
    return float(np.sum(values[1:] * values[:-1]) / np.sum(values**2))
