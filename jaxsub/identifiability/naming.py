"""The names and units of a vehicle's states."""

from ..effects import CHANNEL_UNITS, VELOCITIES
from ..vehicle import AbstractVehicle


def state_names(vehicle: AbstractVehicle) -> dict[str, str]:
    """The unit of each state, in order: velocities of the free equations (`v`, or `x_rate`), then positions."""
    layout = vehicle.layout
    if layout.kind != "submerged-body":
        return dict.fromkeys([*(f"{e}_rate" for e in layout.equations), *layout.positions], "")
    names = [VELOCITIES[e] for e in layout.equations] + list(layout.positions)
    return {name: CHANNEL_UNITS.get(name, "") for name in names}
