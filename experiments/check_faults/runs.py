"""Clean simulated runs with sensors of several kinds."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from jaxsub.recording import Recording
from jaxsub.simulation import prbs, synthetic
from jaxsub.vehicle import AbstractVehicle, vehicle_from
from jaxsub.vehicle.catalogue import dsrv, nps_auv_ii

SAMPLES = 600
# the noise and the clock of each kind of log; thresholds were set on white noise at 10 Hz alone
SENSORS = ("white", "coloured", "quantised", "1 Hz", "uneven")
_COLOUR = 0.9  # correlation of neighbouring samples
_QUANTUM = 2.0  # σ


def surface_vessel() -> AbstractVehicle:
    """Three degrees of freedom in the horizontal plane with position, velocities, heading and its rate."""
    damping = {"X_u": -15.0, "Y_v": -80.0, "N_r": -30.0, "N_v": -10.0}
    added = {"X_udot": -5.0, "Y_vdot": -60.0, "N_rdot": -20.0}
    sigma = {"u": 0.01, "v": 0.01, "r": 0.003, "psi": 0.005, "x": 0.05, "y": 0.05}
    return vehicle_from(
        {
            "schema": 1, "name": "surface vessel", "kind": "submerged-body", "dof": ["surge", "sway", "yaw"],
            "body": {"mass": 60.0, "inertia": [1.0, 12.0, 12.0], "speed": 1.5},
            "coefficients": damping | added | {"Y_delta_r": 20.0, "N_delta_r": -15.0},
            "inputs": {"rudder": "delta_r", "thrust": "T"},
            "outputs": {name: {"sigma": value} for name, value in sigma.items()},
        },
        "surface_vessel.toml",
    )  # fmt: skip


def oscillator() -> AbstractVehicle:
    """A mass on a spring with its position and its rate."""
    return vehicle_from(
        {
            "schema": 1, "name": "oscillator", "kind": "mechanism", "dof": ["x"],
            "coefficients": {"D_x": 0.6, "K_x": 4.0, "B_x_drive": 2.0}, "inputs": {"drive": "f"},
            "outputs": {"x": {"sigma": 0.01}, "x_rate": {"sigma": 0.02}},
        },
        "oscillator.toml",
    )  # fmt: skip


VEHICLES = {"surface vessel": surface_vessel, "NPS AUV II": nps_auv_ii, "DSRV": dsrv, "oscillator": oscillator}
# the DSRV would pitch over at 1 Hz with more
_AMPLITUDES = {"oscillator": 1.0, "surface vessel": 0.2, "DSRV": 0.01}


def clean_runs(name: str, sensors: str, seeds: Sequence[int]) -> tuple[AbstractVehicle, list[Recording]]:
    """A vehicle and one run a seed with `sensors` of a kind."""
    vehicle = VEHICLES[name]()
    inputs = [_driven(vehicle, name, sensors, seed) for seed in seeds]
    exact = synthetic(vehicle, inputs, seed=0, noise=False)
    return vehicle, [_measured(vehicle, run, sensors, seed) for run, seed in zip(exact, seeds, strict=True)]


def _driven(vehicle: AbstractVehicle, name: str, sensors: str, seed: int) -> Recording:
    draws = np.random.default_rng([seed, 1])
    interval = 1.0 if sensors == "1 Hz" else 0.1
    steps = draws.uniform(0.5, 1.5, SAMPLES) if sensors == "uneven" else np.ones(SAMPLES)
    times = interval * (np.cumsum(steps) - steps[0])
    hold = int(draws.integers(10, 40))
    columns = {c: np.full(SAMPLES, np.nan) for c in vehicle.layout.channels}
    for index, (actuator, column) in enumerate(vehicle.layout.inputs):
        push = prbs(SAMPLES, hold, _AMPLITUDES.get(name, 0.1), 100 * seed + index)
        columns[column] = 30.0 + 50.0 * push if actuator == "thrust" else push
    return Recording(f"{name} {seed}", times, columns, f"{name} {seed}, {sensors}")


def _measured(vehicle: AbstractVehicle, run: Recording, sensors: str, seed: int) -> Recording:
    draws = np.random.default_rng([seed, 2])
    columns = dict(run.columns)
    for output in vehicle.layout.outputs:
        noise = draws.standard_normal(SAMPLES)
        if sensors == "coloured":
            for row in range(1, SAMPLES):
                noise[row] = _COLOUR * noise[row - 1] + np.sqrt(1.0 - _COLOUR**2) * noise[row]
        sigma = output.sigma or 0.0
        values = columns[output.channel] + sigma * noise
        if sensors == "quantised":
            values = _QUANTUM * sigma * np.round(values / (_QUANTUM * sigma))
        columns[output.channel] = values
    return dataclasses.replace(run, columns=columns)
