"""The prior of all fits of a diagnosis: wide about each number of the vehicle file that has none."""

import dataclasses
import math

from ...parameters import Parameter
from ...vehicle import AbstractVehicle
from .. import settings


def with_wide_priors(vehicle: AbstractVehicle) -> AbstractVehicle:
    """A vehicle with a wide prior about each free number of its file that has none.

    The recordings hardly identify some, such as the cubic derivatives of a ship in gentle turns: free of a prior, these
    take up what is missing with values a hundred times too large, and follow it in no other run.
    """
    own = vehicle.own_values()

    def widened(row: Parameter) -> Parameter:
        width = settings.PRIOR_WIDTH * abs(row.prior_mean)
        wide = row.free and row.name in own and width > 0.0 and math.isinf(row.prior_std)
        return dataclasses.replace(row, prior_std=width) if wide else row

    return vehicle.with_rows(widened)


def with_priors_of(file: AbstractVehicle, vehicle: AbstractVehicle) -> AbstractVehicle:
    """A `vehicle` under the priors that its `file` states of the numbers that both have."""
    stated = {row.name: row.prior_std for row in file.layout.parameters}
    return vehicle.with_rows(lambda row: dataclasses.replace(row, prior_std=stated.get(row.name, row.prior_std)))
