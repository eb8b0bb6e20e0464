"""What all parts of the experiment share: the vehicle, its scenarios, and the coefficients that they identify."""

import dataclasses
from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np

from jaxsub.control import scenario_one, scenario_two
from jaxsub.estimate import Found, Problem, SearchEnd, Solution, batch, evaluate
from jaxsub.recording import Recording
from jaxsub.simulation import at_rest
from jaxsub.vehicle import AbstractVehicle
from jaxsub.vehicle.catalogue import nps_auv_ii

SECONDS, DT = 75.0, 0.25
# what the report on identifiability says neither scenario identifies: surge drag against thrust, damping by roll rate
HELD = ("X_u", "Y_p", "N_p")


def with_free(vehicle: AbstractVehicle, names: Sequence[str]) -> AbstractVehicle:
    """`vehicle` with exactly the coefficients `names` free."""
    rows = tuple(dataclasses.replace(row, free=row.name in names) for row in vehicle.layout.parameters)
    return dataclasses.replace(vehicle, layout=dataclasses.replace(vehicle.layout, parameters=rows))


def truth() -> AbstractVehicle:
    """NPS AUV II with all damping and control coefficients free that the scenarios identify."""
    vehicle = nps_auv_ii()
    return with_free(vehicle, [row.name for row in vehicle.layout.free if row.name not in HELD])


def everything(vehicle: AbstractVehicle) -> AbstractVehicle:
    """`vehicle` with every hydrodynamic coefficient free, added mass included: what the paper estimates."""
    names = [row.name for row in vehicle.layout.parameters if row.name[:2] in {f"{letter}_" for letter in "XYZKMN"}]
    return with_free(vehicle, names)


def recordings(scenario: int, seed: int) -> list[Recording]:
    """Scenario I or II flown by the true vehicle."""
    if scenario == 1:
        return [scenario_one(truth(), SECONDS, DT, seed=seed)[0]]
    return scenario_two(truth(), SECONDS, DT, seed=seed, rudder=0.3, elevator=0.2, hold=2.0)


def sigma(vehicle: AbstractVehicle) -> jnp.ndarray:
    """The noise in the vehicle's file."""
    return jnp.array([output.sigma for output in vehicle.layout.outputs])


def problem(vehicle: AbstractVehicle, recorded: Sequence[Recording]) -> Problem:
    """Fitting `vehicle` to `recorded`, which begin at rest at the operating speed, as the paper's do."""
    runs = batch(vehicle, recorded)
    return Problem.of(vehicle, runs, sigma(vehicle), at_rest(vehicle, len(recorded)), known_start=True)


def fitted(problem: Problem, found: Found) -> Solution:
    """The fit where one search ended."""
    vehicle, states = problem.split(found.y)
    outcome = found.cost, found.evaluations, found.result
    return evaluate(SearchEnd(vehicle, problem.runs, states, problem.sigma, *outcome, known_start=True))


def relative_errors(vehicle: AbstractVehicle, true: AbstractVehicle) -> dict[str, float]:
    """(estimate - truth) / |truth| of each free coefficient."""
    found, right = vehicle.values(), true.values()
    names = [row.name for row in vehicle.layout.free]
    return {name: float((found[name] - right[name]) / np.abs(right[name])) for name in names}
