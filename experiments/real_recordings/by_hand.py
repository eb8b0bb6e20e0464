"""What named physics is worth when a person picks it from the literature: the yardstick for what `diagnose` found.

Every number is by output error (simulation), fitted on the training runs, and judged by simulation of the others.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Array

from jaxsub.estimate import batch, fit, search
from jaxsub.likelihood import output_errors
from jaxsub.recording import Recording
from jaxsub.vehicle import AbstractVehicle, read_vehicle, vehicle_text

from .case import Case


def by_hand(case: Case, folder: Path) -> dict:
    """rms on the test runs of the baseline and of that with `case.picked`, field units; writes `by_hand.toml`."""
    file, results, labels = folder / "by_hand.toml", {}, []
    for label, text in (("baseline", case.vehicle), ("picked", case.vehicle + case.picked)):
        file.write_text(text, encoding="utf-8")
        vehicle = read_vehicle(file)
        fitted = fit(vehicle, case.train)
        file.write_text(vehicle_text(fitted.vehicle, f"{vehicle.layout.name}, physics picked by hand"), "utf-8")
        errors = free_run_errors(fitted.vehicle, case.held, fitted.sigma)
        each = np.sqrt(np.mean(np.concatenate(errors) ** 2, axis=0)).tolist()
        rms = dict(zip(vehicle.layout.channels, each, strict=True))
        results[label] = {f"{c} ({case.channels[c][1]})": case.channels[c][0] * value for c, value in rms.items()}
        labels = [effect.label for effect in vehicle.effects]
    return {"effects": labels, "held_out_rms": results}


def free_run_errors(vehicle: AbstractVehicle, recordings: Sequence[Recording], sigma: Array) -> list[np.ndarray]:
    """Measured less modelled (SI, one (K, c) array a recording); only initial states are found from them."""
    runs = batch(vehicle, recordings)
    start = search(vehicle, runs, sigma=sigma, moving=False).start
    errors = np.asarray(output_errors(vehicle, runs, start))
    return [error[: len(recording.times)] for error, recording in zip(errors, recordings, strict=True)]
