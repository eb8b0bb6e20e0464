"""Identifiability of all hydrodynamic coefficients, and simultaneous drift: where fits that wandered went."""

import dataclasses
from pathlib import Path

import jax.numpy as jnp
import numpy as np

from jaxsub.estimate import Problem, Solution, gauss_newton, scattered
from jaxsub.information import equivalent_systems, identifiability, identifiable_subset, profile
from jaxsub.vehicle import AbstractVehicle
from jaxsub.vehicle.catalogue import nps_auv_ii

from . import setup
from .figures import drifts, profiles

SPREAD, SEED = 0.3, 21
# what an inertial unit alone measures: the velocities of the hull are left to interpretation
INERTIAL = ("p", "q", "r", "phi", "theta", "psi")
# to free besides those identified, and to free alone, so that one family stays open: a row of matrices, and a column
ROW = ("Y_vdot", "Y_pdot", "Y_p")
COLUMN = ("Y_pdot", "K_pdot", "N_pdot", "Y_p", "K_p", "N_p", "Y_r", "K_r", "N_r", "Y_delta_r", "N_delta_r")


def run(out: Path, quick: bool) -> dict:
    """Reports on identifiability, and drift with all channels measured and with an inertial unit alone."""
    starts = 12 if quick else 100
    reports = {}
    for scenario in (1, 2):
        for kind, vehicle in (("catalogue", nps_auv_ii()), ("every_coefficient", setup.everything(setup.truth()))):
            reports[f"scenario_{scenario}_{kind}"] = report(vehicle, scenario)
    known = [row.name for row in setup.truth().layout.free]
    full = setup.with_free(setup.truth(), [*known, *ROW])
    blind = inertial_only(setup.with_free(setup.truth(), COLUMN))
    measured, inertial = wander(full, starts), wander(blind, starts)
    drifts(
        [
            (measured, "Y_vdot", "Y_v", "all channels measured: the sway equation times a number"),
            (inertial, "Y_pdot", "Y_p", "inertial unit only: the paper's eq. 6"),
        ],
        out / "drift.png",
    )
    best = optimum(setup.problem(setup.truth(), setup.recordings(2, 1)))
    lines = profile(best, ["Y_v", "N_r", "K_v", "K_delta_er"])
    profiles(lines, out / "profiles.png")
    strip = lambda found: {key: value for key, value in found.items() if key not in ("ends", "tangents", "names")}
    return reports | {
        "drift": {"all_channels": strip(measured), "inertial_unit_only": strip(inertial)},
        "eq_6": eq_6(blind),
        "profiles": {line.name: {"interval": list(line.interval)} for line in lines},
    }


def optimum(problem: Problem) -> Solution:
    """The fit that Gauss–Newton reaches from a start 20 % off."""
    return setup.fitted(problem, gauss_newton().run(problem, scattered(problem, 0.2, 1, SEED)).one(0))


def report(vehicle: AbstractVehicle, scenario: int) -> dict:
    """What a scenario determines of the vehicle's free coefficients, at the fit."""
    fit = optimum(setup.problem(vehicle, setup.recordings(scenario, 1)))
    said = identifiability(fit)
    return {
        "rank": said.rank,
        "parameters": said.parameters,
        "null_directions": said.null_directions,
        "sentences": said.sentences(),
        "hold_to_identify_the_rest": list(identifiable_subset(fit)),
    }


def inertial_only(vehicle: AbstractVehicle) -> AbstractVehicle:
    """`vehicle` with an inertial unit and nothing else."""
    outputs = tuple(output for output in vehicle.layout.outputs if output.channel in INERTIAL)
    return dataclasses.replace(vehicle, layout=dataclasses.replace(vehicle.layout, outputs=outputs))


def wander(vehicle: AbstractVehicle, count: int) -> dict:
    """Fits of one recording from `count` starts: how far they end apart, along the predicted families and off them."""
    problem = setup.problem(vehicle, setup.recordings(2, 1))
    names = [row.name for row in vehicle.layout.free]
    found = gauss_newton(1e-9).run(problem, scattered(problem, SPREAD, count, SEED))
    cost, y = np.asarray(found.cost), np.asarray(found.y)
    kept = np.isfinite(cost) & (cost < np.nanmin(cost) + 0.5)
    values = vehicle.values()
    truth = np.array([float(values[name]) for name in names])
    families = equivalent_systems(vehicle)
    tangents = np.array([[family.coefficients.get(name, 0.0) for name in names] for family in families]) / np.abs(truth)
    ends = y[kept] - np.asarray(problem.coordinates())
    centred = ends - ends.mean(0)
    basis = np.linalg.qr(tangents.T)[0]
    along = centred @ basis
    off = centred - along @ basis.T
    # off the families the ends should not differ by more than the search's tolerance, in standard errors
    curvature = np.asarray(problem.expand(jnp.asarray(y[kept][0])).hessian)
    distance = np.sqrt(np.maximum(np.einsum("ni,ij,nj->n", off, curvature, off), 0.0))
    return {
        "starts": count,
        "at_the_same_likelihood": int(kept.sum()),
        "families": [family.sentence() for family in families],
        "parameters": len(names),
        "rms_relative_drift_along_the_families": float(np.sqrt(np.mean(along**2) * along.shape[1] / len(names))),
        "largest_relative_drift_of_a_coefficient": float(np.abs(centred).max()),
        "share_of_the_squared_drift_along_the_families": float(np.sum(along**2) / np.sum(centred**2)),
        "median_distance_off_the_families_in_standard_errors": float(np.median(distance)),
        "ends": ends,
        "tangents": tangents,
        "names": names,
    }


def eq_6(vehicle: AbstractVehicle) -> dict:
    """The paper's eq. 6 against the generated family that is led by P[v,p]."""
    values = {name: float(value) for name, value in vehicle.values().items()}
    family = next((f for f in equivalent_systems(vehicle) if f.leading == "P[v,p]"), None)
    if family is None:
        return {"found": False}
    expected = {"Y_pdot": -(values["mass"] - values["Y_vdot"]), "Y_p": values["Y_v"]}
    return {"found": True, "family": family.sentence(), "expected": expected} | {
        "got": {name: family.coefficients.get(name, 0.0) for name in expected}
    }
