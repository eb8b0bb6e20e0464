"""Vehicles and recordings that tests in several rooms start from."""

from pathlib import Path
from typing import Any

import numpy as np

from jaxsub.effects import Facts, candidates, with_numbers
from jaxsub.recording import Recording, save
from jaxsub.recording.runs import Runs, stack_runs
from jaxsub.simulation import prbs, synthetic
from jaxsub.vehicle import AbstractVehicle, Mechanism, vehicle_from, write_vehicle

# one over what is a usual size, where others are of the order of a hundredth
_SMALL = {"hull-compressibility": 3e9, "thermal-expansion": 3e4, "density-stratification": 3e4}


def stacked(vehicle: AbstractVehicle, recordings: list[Recording], substeps: int = 1) -> Runs:
    layout = vehicle.layout
    columns = {"held": layout.held, "interpolated": layout.interpolated, "channels": layout.columns}
    return stack_runs(recordings, **columns, angles=layout.angles, substeps=substeps)


def driven(vehicle: AbstractVehicle, times: np.ndarray, seed: int, amplitude: float = 0.1, hold: int = 15) -> Recording:
    """A recording whose held inputs are random telegraph signals; what else it has to have, it has as a slow wave."""
    layout = vehicle.layout
    columns = {name: np.full(len(times), np.nan) for name in layout.columns}
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


def write_rig(folder: Path, samples: int = 120) -> None:
    """Write `vehicle.toml`, the oscillator, and `run.csv`, a recording of it."""
    vehicle = oscillator()
    inputs = driven(vehicle, 0.1 * np.arange(samples), seed=1, amplitude=1.0)
    save(synthetic(vehicle, [inputs], seed=1)[0], folder / "run.csv")
    write_vehicle(vehicle, folder / "vehicle.toml")


def coupled() -> Mechanism:
    """Two coordinates that share inertia, friction and a spring."""
    values = {"I_a": 2.0, "I_b": 1.0, "I_a_b": 0.3, "D_a": 0.5, "D_b": 0.2, "D_a_b": 0.1}
    values |= {"K_a": 3.0, "K_b": 5.0, "K_a_b": -1.0, "B_a_drive": 1.0, "F_b": 0.2}
    outputs = {"a": {"sigma": 0.01}, "b": {"sigma": 0.01}, "b_rate": {"sigma": "estimate"}}
    return oscillator(name="coupled", dof=["a", "b"], coefficients=values, outputs=outputs)


def body():
    """Six degrees of freedom with every actuator, an altitude and sensors of every kind."""
    damping = {"X_u": -15.0, "Y_v": -80.0, "Z_w": -80.0, "K_p": -8.0, "M_q": -30.0, "N_r": -30.0, "N_v": -10.0}
    added = {"X_udot": -5.0, "Y_vdot": -60.0, "Z_wdot": -60.0, "M_qdot": -20.0, "N_rdot": -20.0}
    fins = {"Y_delta_r": 20.0, "N_delta_r": -15.0, "Z_delta_e": -20.0, "M_delta_e": -15.0}
    channels = ("u", "v", "r", "q", "phi", "theta", "psi", "depth", "ax", "az", "y")
    return vehicle_from(
        {
            "schema": 1, "name": "body", "kind": "submerged-body",
            "body": {"mass": 60.0, "inertia": [1.0, 12.0, 12.0], "speed": 1.5, "centre_of_buoyancy": [0.0, 0.0, -0.02]},
            "coefficients": damping | added | fins,
            "inputs": {"rudder": "dr", "elevator": "de", "thrust": "T"},
            "environment": {"altitude": "h", "temperature": "C"},
            "outputs": {channel: {"sigma": 0.01} for channel in channels},
        },
        "body.toml",
    )  # fmt: skip


def _facts(vehicle):
    layout = vehicle.layout
    every = lambda names, value: dict.fromkeys(names, value)
    inputs = tuple(name for name, _ in layout.inputs)
    coordinates = every(layout.equations, 0.2) if layout.kind == "mechanism" else {}
    return Facts(
        layout.kind, layout.equations, inputs, layout.channels, tuple(name for name, _ in layout.environment),
        layout.length, layout.diameter, every(layout.equations, 0.3), 0.1, 2.0, coordinates,
        every(inputs, (0.1, 0.2, 1.0)), every(layout.channels, (0.0, 0.2)), (0.0, 2.0),
        every(layout.equations, (1.0,)), 9, fixed_gains=vehicle.fixed_gains,
    )  # fmt: skip


def chosen(vehicle):
    """One effect of each kind that fits the vehicle, every number other than its default and of the sign of physics."""
    first = {}
    for effect in candidates(_facts(vehicle)):
        first.setdefault(type(effect), effect)
    size = lambda effect, i, sign: (sign or 1) * (i + 1.0) / _SMALL.get(effect.name, 37.0)
    sizes = lambda effect: {name: size(effect, i, sign) for i, (name, sign) in enumerate(effect.signs().items())}
    return [with_numbers(effect, sizes(effect)) for effect in first.values()]
