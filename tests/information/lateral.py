"""Vehicles of few equations whose coefficients drift together, or do not."""

import dataclasses

from jaxsub.vehicle import AbstractVehicle
from jaxsub.vehicle.catalogue import dsrv, nps_auv_ii


def seen(vehicle: AbstractVehicle, channels: str, free: str) -> AbstractVehicle:
    """`vehicle` with only those `channels` measured and exactly the coefficients `free` free (each a list in words)."""
    layout = vehicle.layout
    rows = tuple(dataclasses.replace(row, free=row.name in free.split()) for row in layout.parameters)
    outputs = tuple(output for output in layout.outputs if output.channel in channels.split())
    return dataclasses.replace(vehicle, layout=dataclasses.replace(layout, parameters=rows, outputs=outputs))


def lateral(channels: str, free: str) -> AbstractVehicle:
    """Sway, roll and yaw of NPS AUV II."""
    vehicle = nps_auv_ii()
    layout = dataclasses.replace(vehicle.layout, equations=("sway", "roll", "yaw"), positions=("phi", "psi"))
    return seen(dataclasses.replace(vehicle, layout=layout), channels, free)


def diving(channels: str, free: str) -> AbstractVehicle:
    """Heave and pitch of the DSRV."""
    return seen(dsrv(), channels, free)
