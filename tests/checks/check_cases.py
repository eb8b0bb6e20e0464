"""Clean runs of vehicles, and faults put into them."""

import dataclasses
import functools

import numpy as np
from rigs import body, coupled, driven, oscillator

from jaxsub.recording import Recording
from jaxsub.simulation import synthetic
from jaxsub.vehicle import AbstractVehicle
from jaxsub.vehicle.catalogue import dsrv, nps_auv_ii, remus_100

VEHICLES = {
    "nps": nps_auv_ii,
    "remus": remus_100,
    "dsrv": dsrv,
    "oscillator": oscillator,
    "coupled": coupled,
    "body": body,
}
SAMPLES = {"remus": 300, "body": 300}
# the catalogue's REMUS is unstable in open loop, and a run of it has to be short
STEPS = {"remus": 0.01}
AMPLITUDES = {"remus": 0.03}


@functools.cache
def vehicle_named(name: str) -> AbstractVehicle:
    return VEHICLES[name]()


@functools.cache
def clean(name: str, seed: int = 0) -> Recording:
    """A run that the vehicle of that name made, with its sensors' noise."""
    vehicle = vehicle_named(name)
    count = SAMPLES.get(name, 600)
    times = STEPS.get(name, 0.1) * np.arange(count)
    return synthetic(vehicle, [driven(vehicle, times, seed, AMPLITUDES.get(name, 0.1))], seed=seed)[0]


def changed(recording: Recording, **columns: np.ndarray) -> Recording:
    """The run with other columns."""
    return dataclasses.replace(recording, columns=recording.columns | columns)


def with_values(recording: Recording, name: str, rows: slice | np.ndarray, values: object) -> Recording:
    """The run with `values` in `rows` of one column."""
    column = recording.columns[name].copy()
    column[rows] = values
    return changed(recording, **{name: column})


def found(checked, check: str) -> list:
    return [finding for finding in checked.findings if finding.check == check]
