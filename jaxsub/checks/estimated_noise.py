"""Whether a noise that was estimated is noise: what a model leaves of a channel, beside how much that varies."""

from collections.abc import Mapping, Sequence

import numpy as np

from ..findings import Finding
from ..recording import Recording
from ..vehicle import AbstractVehicle

# of a channel's own standard deviation: a model that leaves more explains less than three quarters of its variance
_MOST = 0.5
HARDLY_FOLLOWED = "hardly-followed"


def hardly_followed(
    vehicle: AbstractVehicle, sigma: Mapping[str, float], recordings: Sequence[Recording]
) -> list[Finding]:
    """A warning for each output whose noise is estimated and as large as what `recordings` show of it.

    `sigma` are the estimates by output of `vehicle`, in the unit of its column. Where one is over half of the column's
    standard deviation within runs, the fit has taken motion for noise, and every test against it is empty.
    """
    found = []
    for output in vehicle.layout.outputs:
        column = vehicle.layout.measured[output.name]
        runs = [run.columns[column] for run in recordings if np.isfinite(run.columns.get(column, np.nan)).any()]
        if output.sigma is not None or output.name not in sigma or not runs:
            continue
        varies = float(np.sqrt(np.nanmean(np.concatenate([values - np.nanmean(values) for values in runs]) ** 2)))
        if sigma[output.name] > _MOST * varies:
            unit = f" {vehicle.layout.unit(output.name)}".rstrip()
            sizes = f"its noise is estimated at {sigma[output.name]:.3g}{unit}, and it varies by {varies:.3g}{unit}"
            what = f"the model hardly follows it, and the verdict says little: {sizes}"
            remedy = "state sigma, begin runs where their inputs say all that drives the vehicle, or start closer"
            found.append(Finding(HARDLY_FOLLOWED, "warning", recordings[0].source, what, remedy, column))
    return found
