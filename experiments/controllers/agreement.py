"""How far each export of a plant is from the plant, and how long a step takes in each."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import control
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxsub.control import (
    Plant,
    casadi_jacobians,
    casadi_plant,
    control_system,
    discretise,
    export_plant,
    linearisation_error,
    linearise,
    load_plant,
    require_trim,
    trim,
)
from jaxsub.effects import ActuatorDelay, ActuatorLag, CrossflowDrag, Current, FluidMemory, SensorDelay
from jaxsub.parameters import number
from jaxsub.symbolic import Native, compiled
from jaxsub.vehicle import AbstractVehicle
from jaxsub.vehicle.catalogue import dsrv, nps_auv_ii, remus_100

DT = 0.2


def remembering() -> AbstractVehicle:
    """NPS AUV II with effects that carry something from sample to sample."""
    vehicle = nps_auv_ii()
    for effect in (
        ActuatorDelay("rudder", number(0.5)), ActuatorLag("rudder", number(0.6)), SensorDelay("psi", number(0.4)),
        FluidMemory("sway", number(-200.0), number(1.5)), CrossflowDrag("horizontal", 5.3, 0.7, number(0.6)),
        Current(vehicle.layout.equations, number(0.3), number(-0.1)),
    ):  # fmt: skip
        vehicle = vehicle.with_effect(effect)
    return vehicle


VEHICLES = {"NPS AUV II": nps_auv_ii, "REMUS 100": remus_100, "DSRV": dsrv, "NPS AUV II with memories": remembering}


def agreement(out: Path, quick: bool) -> dict:
    """A row for each vehicle; quick, for the plainest and the one that remembers most."""
    first, *_, last = VEHICLES
    chosen = (first, last) if quick else tuple(VEHICLES)
    count = 50 if quick else 200
    return {name: _row(discretise(VEHICLES[name](), DT), out / "exported.plant", count) for name in chosen}


def _row(plant: Plant, path: Path, count: int) -> dict:
    rng = np.random.default_rng(11)
    x = 0.3 * rng.standard_normal((count, len(plant.states)))
    x[:, 0] += 1.5
    u = 0.2 * rng.standard_normal((count, len(plant.inputs)))
    step, jacobians = eqx.filter_jit(plant.step), eqx.filter_jit(plant.jacobians)
    function = casadi_plant(plant)
    linear, native = casadi_jacobians(function), compiled(function)
    export_plant(plant, path)
    loaded = load_plant(path)
    system = control_system(plant)
    now = jnp.asarray(0.0)
    ways: dict[str, Callable] = {
        "JAX": lambda x, u: step(x, u, now),
        "python-control": lambda x, u: system.dynamics(0.0, x, u),
        "CasADi": lambda x, u: np.asarray(function(x, u, 0.0)[0]).ravel(),
        "C": lambda x, u: _called(native, x, u),
        "exported": loaded.step,
    }
    expected = np.stack([np.asarray(step(*at, now)) for at in zip(x, u, strict=True)])
    scale = np.abs(expected).max(axis=0)
    rows = {}
    for name, way in ways.items():
        found = np.stack([np.asarray(way(*at)) for at in zip(x, u, strict=True)])
        rows[name] = {
            "error": float(np.abs((found - expected) / scale).max()),
            "step_us": _microseconds(way, x[0], u[0]),
        }
    by = [np.concatenate([np.ravel(part) for part in jacobians(*at, now)]) for at in zip(x, u, strict=True)]
    theirs = [np.concatenate([np.ravel(p.full()) for p in linear(*at, 0.0)]) for at in zip(x, u, strict=True)]
    flown = _flown(plant, system)
    return {
        "steps": rows,
        "states": len(plant.states),
        "casadi_instructions": function.n_instructions(),
        "casadi_jacobian_error": float(np.abs(np.array(by) - np.array(theirs)).max()),
        "python_control_flight_error": flown,
        "linear": _linear(plant),
        "exported_bytes": path.stat().st_size,
    }


def _called(native: Native, x: np.ndarray, u: np.ndarray) -> np.ndarray:
    """The next state by the C of a plant, at the time zero."""
    native.given[0][:], native.given[1][: len(u)], native.given[2][:] = x, u, 0.0
    native()
    return native.found[0].copy()


def _flown(plant: Plant, system: control.NonlinearIOSystem) -> float:
    """The largest deviation of a python-control simulation of 10 s from the plant's."""
    inputs = 0.05 * np.sign(np.random.default_rng(1).standard_normal((50, len(plant.inputs))))
    start = np.zeros(len(plant.states))
    start[0] = 1.5
    respond: Any = control.input_output_response  # its annotations know of single numbers alone
    flown = respond(system, plant.dt * np.arange(50), inputs.T, start)
    states = jax.jit(lambda x, u: plant.run(x, u))(jnp.asarray(start), jnp.asarray(inputs))
    return float(np.abs(flown.states.T - states[:-1]).max())


def _linear(plant: Plant) -> dict:
    """The linear form about the trim: its largest error in any state over 2 s of deflections of a size in rad."""
    found = require_trim(plant, trim(plant))
    linear = linearise(plant, found.x, found.u)
    signs = np.sign(np.random.default_rng(2).standard_normal((10, len(plant.inputs))))
    errors = {f"{a:g}": linearisation_error(plant, linear, found.u + a * jnp.asarray(signs)) for a in (0.01, 0.05, 0.2)}
    return {size: float(jnp.max(error)) for size, error in errors.items()}


def _microseconds(way: Callable, x: np.ndarray, u: np.ndarray, calls: int = 200) -> float:
    """The median time of a call, s·10⁻⁶."""
    taken = []
    for _ in range(calls):
        begin = time.perf_counter()
        np.asarray(way(x, u))
        taken.append(time.perf_counter() - begin)
    return 1e6 * float(np.median(taken))
