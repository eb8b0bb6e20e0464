"""One concealed effect: recordings, baseline, diagnosis, and the flights of three controllers against the truth."""

import os
import tempfile
from pathlib import Path

import jax
import numpy as np

from jaxsub.cli.demo import make_files
from jaxsub.control import Mpc, Pursuit, discretise, pursue
from jaxsub.discrepancy import diagnose
from jaxsub.effects import AbstractEffect, ActuatorLag, HullAsymmetry
from jaxsub.estimate import fit
from jaxsub.parameters import number
from jaxsub.recording import load
from jaxsub.vehicle import AbstractVehicle, read_vehicle, write_vehicle
from jaxsub.vehicle.catalogue import nps_auv_ii

from .figure import draw

DT, SECONDS, SETTLING = 0.2, 80.0, 10.0
# pitch and roll in rad, depth in m
WITHIN = {"theta": (-0.25, 0.25), "phi": (-0.35, 0.35), "z": (-1.0, 4.2)}
CASES: dict[str, AbstractEffect] = {
    "actuator-lag": ActuatorLag("rudder", number(1.5)),
    "hull-asymmetry": HullAsymmetry("yaw", number(250.0)),
}


def references(seconds: float) -> dict[str, np.ndarray]:
    """Depth between 0 and 4 m and heading between 34° to port and to starboard, both as slow waves."""
    t = DT * np.arange(round(seconds / DT))
    return {"z": 2.0 * (1.0 - np.cos(2.0 * np.pi * t / 40.0)), "psi": 0.6 * np.sin(2.0 * np.pi * t / 30.0)}


def flights(name: str, out: Path, quick: bool) -> dict:
    """What the diagnosis says, and how each controller flew."""
    effect = CASES[name]
    truth = nps_auv_ii().with_effect(effect)
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        make_files(folder, 1, effect)
        vehicle = read_vehicle(folder / "vehicle.toml")
        runs = [load(path) for path in sorted(folder.glob("run*.csv"))]
        diagnosis, found = diagnose(vehicle, runs[:-1], runs[-1:])
        write_vehicle(found, folder / "improved.toml", "improved by a diagnosis")
        improved = read_vehicle(folder / "improved.toml")
    baseline = fit(vehicle, runs[:-1]).vehicle
    models = {"baseline": baseline, "improved": improved, "truth": truth}
    seeds = range(1, 2 if quick else 6)
    wanted = references(40.0 if quick else SECONDS)
    one_core()
    flown = {kind: _flown(truth, model, wanted, seeds) for kind, model in models.items()}
    draw(out / f"{name}.png", name, {kind: some[0] for kind, some in flown.items()}, DT)
    return {
        "concealed": {"effect": effect.label, **{k: float(v) for k, v in _numbers(truth, effect).items()}},
        "verdict": diagnosis.verdict,
        "named": [physics.label for physics in diagnosis.physics],
        "found": {k: float(v) for k, v in improved.values().items() if k.startswith(effect.label)},
        "controllers": {kind: summary(some) for kind, some in flown.items()},
    }


def one_core() -> None:
    """This process on one core from now on; XLA is started before, for on a single core it finds no LAPACK."""
    jax.devices()
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})


def _numbers(truth: AbstractVehicle, effect: AbstractEffect) -> dict:
    return {name: value for name, value in truth.values().items() if name.startswith(effect.label)}


def _flown(
    truth: AbstractVehicle, model: AbstractVehicle, wanted: dict[str, np.ndarray], seeds: range
) -> list[Pursuit]:
    """The controller of `model` against `truth`, a flight for each seed of the sensors' noise."""
    plant = discretise(truth, DT)
    controller = Mpc.of(discretise(model, DT), {"z": 0.3, "psi": 0.05}, WITHIN, effort=2.0, pace=1.0)
    return [pursue(plant, controller, wanted, seed=seed) for seed in seeds]


def summary(some: list[Pursuit]) -> dict:
    """Errors, effort, constraints and times over the flights, the first seconds of settling left out of the errors."""
    late = round(SETTLING / DT)
    error = {
        c: np.concatenate([(f.truth[c] - f.wanted[:, i])[late:] for f in some]) for i, c in enumerate(("z", "psi"))
    }
    moves = np.concatenate([np.diff(f.inputs, axis=0) / DT for f in some])
    times = np.concatenate([f.seconds for f in some])
    past = {
        c: max(float(np.max(np.maximum(f.truth[c] - high, low - f.truth[c]))) for f in some)
        for c, (low, high) in WITHIN.items()
    }
    beyond = [np.any([(f.truth[c] > h) | (f.truth[c] < lo) for c, (lo, h) in WITHIN.items()], axis=0) for f in some]
    quantiles = lambda values: {f"p{q:g}": 1e3 * float(np.percentile(values, q)) for q in (50, 99, 100)}
    return {
        "depth_rms_m": float(np.sqrt(np.mean(error["z"] ** 2))),
        "heading_rms_deg": float(np.degrees(np.sqrt(np.mean(error["psi"] ** 2)))),
        "heading_rms_deg_of_each": [
            float(np.degrees(np.sqrt(np.mean((f.truth["psi"] - f.wanted[:, 1])[late:] ** 2)))) for f in some
        ],
        "deflection_rms_deg": float(np.degrees(np.sqrt(np.mean(np.concatenate([f.inputs for f in some]) ** 2)))),
        "deflection_rate_rms_deg_s": float(np.degrees(np.sqrt(np.mean(moves**2)))),
        "deflection_most_deg": float(np.degrees(max(np.abs(f.inputs).max() for f in some))),
        "rate_most_deg_s": float(np.degrees(np.abs(moves).max())),
        "past_limit": {c: max(value, 0.0) for c, value in past.items()},
        "share_of_samples_past_a_limit": float(np.mean(np.concatenate(beyond))),
        "wall_ms": quantiles(times),
        "processor_ms": quantiles(np.concatenate([f.work for f in some])),
        "share_over_200_ms": float(np.mean(times > DT)),
        "steps_mean": float(np.mean(np.concatenate([f.solved.steps for f in some]))),
        "samples": len(times),
    }
