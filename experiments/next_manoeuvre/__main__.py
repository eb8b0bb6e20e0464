"""`python -m experiments.next_manoeuvre --out DIR [--quick]`: do designed inputs settle what a weak record leaves open?

Rivals are fitted to a weak record and the next manoeuvre is designed from the fits. The truth is then driven with noise
by the recorded inputs again, by a random telegraph signal within the same limits of the actuators and by the design;
every rival is fitted to each run alone. `share_right`: of the seeds, where the truth fits best; `share_settled`: where
it does so by a likelihood ratio above 99. `gap`: χ² of the best rival less that of the truth, beside what was expected.
`diagnosis`: verdicts of `jaxsub diagnose` on runs driven by the recorded inputs and by the design.
"""

import time
from pathlib import Path

import jax.numpy as jnp
import numpy as np

from experiments.parts import main
from jaxsub.discrepancy import diagnose
from jaxsub.estimate import batch, search
from jaxsub.information.design_limits import Bounds, ManoeuvreLimits
from jaxsub.information.design_search import telegraphs
from jaxsub.information.separating_manoeuvre import Manoeuvre, recorded_limits, separating_manoeuvre
from jaxsub.recording import Recording
from jaxsub.vehicle import AbstractVehicle

from .cases import CASES, Case, case
from .figure import draw

_SETTLED = 2.0 * np.log(99.0)
_HOLD = "telegraph of 16 samples"


def part(name: str, out: Path, quick: bool) -> dict:
    """One case."""
    seconds = 120.0 if name == "roll-moment" and not quick else 60.0
    made = case(name, seconds)
    layout = made.vehicle.layout
    sigma = np.array([output.sigma for output in layout.outputs])
    models = [_fitted(made.vehicle.with_effect(rival), made.record)[0] for rival in made.rivals]
    begin = time.perf_counter()
    found = separating_manoeuvre(models, made.record, sigma, steps=20 if quick else 60)
    taken = time.perf_counter() - begin
    limits = recorded_limits(models[0], made.record)
    inputs = {"recorded": made.record, "telegraph": _telegraph(made, limits), "design": found.recording}
    seeds = range(1, 4 if quick else 13)
    rows = {kind: _row(made, models, recording, seeds) for kind, recording in inputs.items()}
    for kind, expected in (("recorded", found.before), ("telegraph", found.tried[_HOLD]), ("design", found.separation)):
        rows[kind]["expected"] = expected
    draw(out / f"{name}.png", name, made, inputs, rows, found.history)
    return {
        "truth": made.rivals[0].label,
        "rivals": [rival.label for rival in made.rivals],
        "inputs": rows,
        "pairs": _plain(found.pairs),
        "pairs_before": _plain(found.pairs_before),
        "within": found.within,
        "start": found.start,
        "design_seconds": taken,
        "diagnosis": {} if quick else _diagnosed(made, found),
    }


def _fitted(vehicle: AbstractVehicle, recording: Recording) -> tuple[AbstractVehicle, float]:
    """The vehicle fitted to a recording, and χ²."""
    found = search(vehicle, batch(vehicle, [recording]))
    return found.vehicle, 2.0 * float(found.cost)


def _row(made: Case, models: list[AbstractVehicle], recording: Recording, seeds: range) -> dict:
    """How each rival fits what the truth records with these inputs."""
    runs = [made.driven(recording, 0, noise=False), *(made.driven(recording, seed) for seed in seeds)]
    squares = np.array([[_fitted(model, run)[1] for model in models] for run in runs])
    gaps = np.min(squares[:, 1:], axis=1) - squares[:, 0]
    return {
        "gap_without_noise": float(gaps[0]),
        "gap": gaps[1:].tolist(),
        "share_right": float(np.mean(gaps[1:] > 0.0)),
        "share_settled": float(np.mean(gaps[1:] > _SETTLED)),
    }


def _telegraph(made: Case, limits: ManoeuvreLimits) -> Recording:
    """A random telegraph signal that keeps the limits of the actuators; those of channels it need not keep."""
    held = made.vehicle.layout.held
    bounds = Bounds.of(made.vehicle, limits, made.record.times, made.record.inputs(held)[0])
    inputs = np.asarray(bounds.follow(jnp.asarray(telegraphs(bounds, 0)[_HOLD])))
    return Recording("telegraph", made.record.times, dict(zip(held, inputs.T, strict=True)), "telegraph")


def _diagnosed(made: Case, found: Manoeuvre) -> dict:
    """What a diagnosis says of three runs with the recorded inputs, and of the same with two designed ones besides."""
    before = [made.driven(made.record, seed) for seed in (101, 102, 103)]
    after = [made.driven(found.recording, seed) for seed in (104, 105, 106)]
    said = {}
    for kind, train, held in (("before", before[:2], before[2:]), ("after", [*before[:2], *after[:2]], after[2:])):
        diagnosis, _ = diagnose(made.vehicle, train, held)
        said[kind] = {
            "verdict": diagnosis.verdict,
            "named": [physics.effect for physics in diagnosis.physics],
            "probability": [physics.probability for physics in diagnosis.physics],
            "rivals": [rival.effect for physics in diagnosis.physics for rival in physics.rivals],
        }
    return said


def _plain(pairs: np.ndarray) -> list[list[float | None]]:
    return [[value if np.isfinite(value) else None for value in row] for row in pairs.tolist()]


if __name__ == "__main__":
    main("experiments.next_manoeuvre", __doc__, CASES, part)
