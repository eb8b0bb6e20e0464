"""Vehicles and recordings that tests in several rooms start from."""

from typing import Any

import numpy as np

from jaxsub.recording import Recording
from jaxsub.recording.runs import Runs, stack_runs
from jaxsub.simulate import prbs, synthetic
from jaxsub.vehicle import AbstractVehicle, Mechanism, vehicle_from


def stacked(vehicle: AbstractVehicle, recordings: list[Recording], substeps: int = 1) -> Runs:
    layout = vehicle.layout
    columns = {"held": layout.held, "interpolated": layout.interpolated, "channels": layout.channels}
    return stack_runs(recordings, **columns, substeps=substeps)


def driven(vehicle: AbstractVehicle, times: np.ndarray, seed: int, amplitude: float = 0.1, hold: int = 15) -> Recording:
    """A recording whose held inputs are random telegraph signals; what else it has to have, it has as a slow wave."""
    layout = vehicle.layout
    columns = {name: np.full(len(times), np.nan) for name in layout.channels}
    columns |= {name: 0.1 * np.sin(0.4 * times + i) for i, name in enumerate(layout.interpolated)}
    columns |= {name: prbs(len(times), hold, amplitude, 100 * seed + i) for i, name in enumerate(layout.held)}
    return Recording(f"run {seed}", times, columns, f"run {seed}")


def recorded(vehicle: AbstractVehicle, count: int, samples: int, dt: float, seed: int, **options: Any) -> Runs:
    """`count` recordings that `vehicle` itself would have made, noise included."""
    inputs = [driven(vehicle, dt * np.arange(samples), seed + i, **options) for i in range(count)]
    return stacked(vehicle, synthetic(vehicle, inputs, seed=seed))


def oscillator(**changes: Any) -> Mechanism:
    """One coordinate x with a spring, a damper and a drive."""
    data = {
        "schema": 1,
        "name": "oscillator",
        "kind": "mechanism",
        "dof": ["x"],
        "coefficients": {"D_x": 0.6, "K_x": 4.0, "B_x_drive": 2.0},
        "inputs": {"drive": "f"},
        "outputs": {"x": {"sigma": 0.01}, "x_rate": {"sigma": 0.02}},
    }
    vehicle = vehicle_from(data | changes, "oscillator.toml")
    assert isinstance(vehicle, Mechanism)
    return vehicle


def coupled() -> Mechanism:
    """Two coordinates that share inertia, friction and a spring."""
    values = {"I_a": 2.0, "I_b": 1.0, "I_a_b": 0.3, "D_a": 0.5, "D_b": 0.2, "D_a_b": 0.1}
    values |= {"K_a": 3.0, "K_b": 5.0, "K_a_b": -1.0, "B_a_drive": 1.0, "F_b": 0.2}
    outputs = {"a": {"sigma": 0.01}, "b": {"sigma": 0.01}, "b_rate": {"sigma": "estimate"}}
    return oscillator(name="coupled", dof=["a", "b"], coefficients=values, outputs=outputs)
