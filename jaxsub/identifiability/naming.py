"""The names and units of a vehicle's states."""

from ..effects import VELOCITIES
from ..vehicle import AbstractVehicle


def state_names(vehicle: AbstractVehicle) -> dict[str, str]:
    """The unit of each state, in order: velocities of the free equations (`v`, or `x_rate`), then positions."""
    layout = vehicle.layout
    body = layout.kind == "submerged-body"
    velocities = [VELOCITIES[e] if body else f"{e}_rate" for e in layout.equations]
    return {name: layout.unit(name) for name in (*velocities, *layout.positions)}
