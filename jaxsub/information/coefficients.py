"""Each fitted coefficient with its standard errors and what may be said of it."""

import dataclasses
import math

from ..estimate import Solution
from .coloured import Coloured
from .directions import FRACTION
from .rank import Identifiability

# what stands for a verdict where none was reached
UNKNOWN = "not asked"
# and for one that holds for white residuals alone
WHITE_ALONE = "identified only if residuals were white"
_LONGER = "forces that the model lacks hide it: record longer runs, or try jaxsub diagnose"


@dataclasses.dataclass(frozen=True)
class CoefficientEstimate:
    """A fitted coefficient.

    **Fields**

    - `name`, `value`, `unit`: SI.
    - `standard_error`: allows for coloured and oversized residuals. `standard_error_white`: takes them for white noise
      of the given σ. None where there is none: at a bound, or where nothing bounds the coefficient.
    - `verdict`: `identified`, for which `standard_error` is below half its size too, or why not. `remedy`: what would
      identify it.
    """

    name: str
    value: float
    unit: str
    standard_error: float | None
    standard_error_white: float | None
    verdict: str
    remedy: str = ""


def estimates(fit: Solution, said: Identifiability | None, coloured: Coloured | None) -> list[CoefficientEstimate]:
    """The coefficients of `fit` with their standard errors and verdicts.

    `said` is what the recordings identify and `coloured` the covariance for coloured residuals; either is None where it
    was not computed. Where the residuals' disturbance could not be estimated, the standard errors for white noise are
    multiplied by the largest rms of a channel, if that is above one.
    """
    verdicts = {verdict.name: verdict for verdict in said.verdicts} if said else {}
    unit = {row.name: row.unit for row in fit.vehicle.layout.free}
    white = fit.standard_errors
    wide = coloured.standard_errors if coloured else {}
    size = max([1.0, *(rms for rms in fit.rms.values() if math.isfinite(rms))])
    found = []
    for name, value in fit.values.items():
        verdict = verdicts.get(name)
        none = name in fit.at_bound or not math.isfinite(white[name])
        if verdict and verdict.kind in ("only in combination", "not excited"):
            none = none or not math.isfinite(verdict.relative_error)
        allowed = wide.get(name, math.nan)
        allowed = allowed if math.isfinite(allowed) else size * white[name]
        errors = (None, None) if none else (allowed, white[name])
        kind, remedy = (verdict.kind, verdict.remedy) if verdict else (UNKNOWN, "")
        if verdict and kind == "identified" and verdict.relative_error * allowed > FRACTION * white[name]:
            kind, remedy = WHITE_ALONE, _LONGER
        found.append(CoefficientEstimate(name, value, unit[name], *errors, kind, remedy))
    return found
