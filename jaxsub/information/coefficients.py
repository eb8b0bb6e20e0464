"""Each fitted coefficient with its standard errors and what may be said of it."""

import dataclasses
import math

import numpy as np

from ..estimate import Solution
from .coloured import Coloured
from .directions import FRACTION
from .rank import FOLLOWS, Identifiability
from .tied import tied_numbers

# what stands for a verdict where none was reached
UNKNOWN = "not asked"
# and for one that holds for white residuals alone
WHITE_ALONE = "identified only if residuals were white"
_LONGER = "forces that the model lacks hide it: record longer runs, or try jaxsub diagnose"


@dataclasses.dataclass(frozen=True)
class CoefficientEstimate:
    """A fitted coefficient, or a number that follows from such.

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
    """The coefficients of `fit` with their standard errors and verdicts, then the numbers that follow from them.

    `said` is what the recordings identify and `coloured` the covariance for coloured residuals; either is None where it
    was not computed. Where the residuals' disturbance could not be estimated, the standard errors for white noise are
    multiplied by the largest rms of a channel, if that is above one.
    """
    verdicts = {verdict.name: verdict for verdict in (*said.verdicts, *said.tied)} if said else {}
    unit = {row.name: row.unit for row in fit.vehicle.layout.free}
    white, values, at_bound = fit.standard_errors, dict(fit.values), {*fit.at_bound}
    wide = coloured.standard_errors if coloured else {}
    for tied in said.tied_numbers if said else tied_numbers(fit):
        values[tied.name], unit[tied.name] = tied.value, tied.unit
        white[tied.name] = tied.error(np.asarray(fit.covariance))
        if coloured:
            wide[tied.name] = tied.error(np.asarray(coloured.covariance))
        at_bound |= {tied.name} if at_bound & {*tied.ends} else set()
    size = max([1.0, *(rms for rms in fit.rms.values() if math.isfinite(rms))])
    found = []
    for name, value in values.items():
        verdict = verdicts.get(name)
        none = name in at_bound or not math.isfinite(white[name])
        if verdict and verdict.kind in ("only in combination", "not excited", FOLLOWS):
            none = none or not math.isfinite(verdict.relative_error)
        allowed = wide.get(name, math.nan)
        allowed = allowed if math.isfinite(allowed) else size * white[name]
        errors = (None, None) if none else (allowed, white[name])
        kind, remedy = (verdict.kind, verdict.remedy) if verdict else (UNKNOWN, "")
        if verdict and kind == "identified" and verdict.relative_error * allowed > FRACTION * white[name]:
            kind, remedy = WHITE_ALONE, _LONGER
        found.append(CoefficientEstimate(name, value, unit[name], *errors, kind, remedy))
    return found
