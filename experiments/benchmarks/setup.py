"""The benchmarks' case: NPS AUV II, three runs, ten channels, 31 free coefficients, a concealed effect."""

import dataclasses
from pathlib import Path

import numpy as np

from jaxsub.cli.demo import inputs
from jaxsub.effects.hull import CrossflowDrag
from jaxsub.parameters import number
from jaxsub.recording import Recording, save
from jaxsub.simulation import sampled_states, synthetic
from jaxsub.vehicle import AbstractVehicle, write_vehicle
from jaxsub.vehicle.catalogue import nps_auv_ii

_ADDED = ("X_udot", "Y_vdot", "Y_pdot", "Y_rdot", "Z_wdot", "Z_qdot", "K_pdot", "M_qdot", "N_rdot", "K_rdot")


def recordings_and_vehicle() -> tuple[AbstractVehicle, list[Recording]]:
    """The vehicle, 20 % off, and recordings of the true one, which conceals cross-flow drag."""
    rng = np.random.default_rng(11)
    vehicle = nps_auv_ii()
    rows = tuple(
        dataclasses.replace(row, free=True, prior_std=0.05 * abs(row.prior_mean)) if row.name in _ADDED else row
        for row in vehicle.layout.parameters
    )
    vehicle = dataclasses.replace(vehicle, layout=dataclasses.replace(vehicle.layout, parameters=rows))
    assert len(vehicle.layout.free) == 31
    driven = [inputs(number, rng) for number in range(3)]
    truth = vehicle.with_effect(
        CrossflowDrag("horizontal", vehicle.layout.length, vehicle.layout.diameter, number(0.7))
    )
    recorded = synthetic(truth, driven, seed=11, states=sampled_states)
    values = vehicle.values()
    fitted = [row.name for row in vehicle.layout.free if row.name not in _ADDED]
    return vehicle.with_values({n: values[n] * (1.0 + 0.2 * rng.uniform(-1.0, 1.0)) for n in fitted}), recorded


def write_files(folder: Path) -> None:
    """The case as files."""
    vehicle, recordings = recordings_and_vehicle()
    write_vehicle(vehicle, folder / "vehicle.toml")
    for recording in recordings:
        save(recording, folder / f"{recording.name}.csv")
