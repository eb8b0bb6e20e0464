"""The whole path: fit, locate, name, model, show."""

import dataclasses
from collections.abc import Sequence

import numpy as np
from jaxtyping import Array

from ..effects import VOCABULARY, AbstractEffect, candidates
from ..errors import InputError
from ..estimate import Fit, fit
from ..recording import Recording
from ..recording.runs import Runs, stack_runs
from ..results import RESULTS
from ..vehicle import AbstractVehicle
from .advice import next_manoeuvre
from .columns import Trajectory, facts
from .diagnosis import Diagnosis, Location, Physics, Rival, Verdict
from .locate import Field, effect_share, locate, locations
from .name import Naming, Step, certain, name
from .process_noise import noise_note, noise_signals
from .refit import SIGNIFICANCE, Progress
from .show import HeldOut, channel_quality, coefficients, estimates, hold, overlays, record_sigma, run_quality
from .whiteness import whiteness_p_value

EXPLAINED = 0.75
_TWIN = 0.01


@dataclasses.dataclass(frozen=True)
class Judged:
    """A verdict, the steps that stand, the mismatch's p-value, and what a reader must know."""

    verdict: Verdict
    steps: list[Step]
    p_value: float
    notes: list[str]


def diagnose(
    vehicle: AbstractVehicle,
    train: Sequence[Recording],
    held: Sequence[Recording],
    *,
    vocabulary: tuple[type[AbstractEffect], ...] = VOCABULARY,
    progress: Progress = lambda message: None,
) -> tuple[Diagnosis, AbstractVehicle]:
    """What physics `vehicle` leaves out according to the runs `train`, shown on the runs `held`.

    Returns the diagnosis and the improved vehicle; `progress` is told what is being done. **Raises** `InputError`
    where the recordings lack a column, or the model does not run from the vehicle file's values.
    """
    layout = vehicle.layout
    runs = batch(vehicle, [*train, *held])
    seen, size = runs.take(range(len(train)), len(train)), len(train)
    progress("fitting the baseline")
    baseline = fit(vehicle, seen)
    if bool(baseline.result == RESULTS.nan_start):
        remedy = "give coefficients that are closer, or a bound on the one that makes it unstable"
        raise InputError(layout.name, "the model does not run from its starting values", remedy)
    path = Trajectory.of(baseline)
    progress("locating the mismatch")
    signals = noise_signals(baseline, train)
    field = locate(baseline, path, train, signals)
    naming = name(baseline, vehicle, lambda found: candidates(facts(vehicle, found), vocabulary), progress)
    progress("free runs through what the fit did not see")
    chosen = range(size, size + len(held))
    sigma = (naming.steps[-1].fit if naming.steps else baseline).sigma
    models = [baseline, *(step.fit for step in naming.steps)]
    held_out = [hold(model.vehicle, runs, chosen, size, sigma) for model in models]
    judged = judge(baseline, naming, held_out)
    before, improved, after = held_out[0], models[len(judged.steps)], held_out[len(judged.steps)]
    remaining = locate(improved, Trajectory.of(improved), train).traces if judged.steps else field.traces
    where = _where(judged, baseline, path, field, train)
    physics = [_physics(step, improved) for step in judged.steps]
    before_train = channel_scaled(baseline, sigma)
    diagnosis = Diagnosis(
        verdict=judged.verdict,
        vehicle=layout.name,
        summary=summary(judged.verdict, physics, where),
        p_value=judged.p_value,
        where=where,
        physics=physics,
        fit={
            "train": {"baseline": before_train, "improved": channel_scaled(improved, sigma)},
            "held_out": {"baseline": before.rms, "improved": after.rms},
        },
        candidates=naming.candidates,
        forces=field.traces,
        remaining_forces=remaining,
        overlays=overlays(held, layout.channels, before, after),
        coefficients=coefficients({k: float(v) for k, v in vehicle.values().items()}, baseline, improved),
        channels=channel_quality(improved),
        runs=[*run_quality(train, "train"), *run_quality(held, "held out")],
        notes=[*judged.notes, *noise_note(signals)],
        next_manoeuvre=next_manoeuvre(judged.verdict, physics),
        history=[
            (label, {c: rms * float(s) for (c, rms), s in zip(seen.rms.items(), sigma, strict=True)})
            for label, seen in zip(["baseline", *(s.label for s in naming.steps)], held_out, strict=True)
        ],
    )
    return diagnosis, improved.vehicle


def batch(vehicle: AbstractVehicle, recordings: Sequence[Recording]) -> Runs:
    """The recordings as the batch that `vehicle` takes, with as many integration steps a sample as it needs."""
    layout = vehicle.layout
    rates = np.linalg.solve(np.asarray(vehicle.mass_matrix()), np.asarray(vehicle.damping_matrix()))
    fastest = float(np.max(np.abs(np.linalg.eigvals(rates))))
    longest = max(float(np.diff(r.times).max()) for r in recordings)
    # linear damping is exact at any step; effects that replace it have the same rate and are not
    substeps = int(np.clip(np.ceil(longest * fastest / 1.5), 1, 16))
    return stack_runs(
        recordings, held=layout.held, interpolated=layout.interpolated, channels=layout.channels, substeps=substeps
    )


def judge(baseline: Fit, naming: Naming, held_out: Sequence[HeldOut]) -> Judged:
    """The verdict: is there a mismatch, does what was named explain it, and does it help on the held-out runs?

    Effects count up to the first that makes the held-out runs worse; `held_out` holds the baseline's and each step's.
    """
    p_value = min(1.0, 2.0 * min(naming.first_p, whiteness_p_value(baseline)))
    if not naming.steps:
        return Judged("unknown" if p_value < SIGNIFICANCE else "none", [], p_value, [])
    squares = [free_run.chi_square for free_run in held_out]
    helped = next((i for i, gain in enumerate(np.diff(squares)) if not gain < 0.0), len(naming.steps))
    steps, notes = naming.steps[:helped], []
    if helped < len(naming.steps):
        refused = naming.steps[helped].label
        notes.append(f"{refused} fitted the training runs better but the held-out runs worse, and is not accepted.")
    if not steps:
        return Judged("unknown", [], p_value, notes)
    best = steps[-1].fit
    left = min(naming.last_p, whiteness_p_value(best))
    share = explained(baseline, best)
    if share < EXPLAINED and left < SIGNIFICANCE:
        labels = ", ".join(step.label for step in steps)
        notes.append(f"{labels} would explain {share:.0%} of the mismatch, too little for its cause.")
        return Judged("unknown", [], p_value, notes)
    notes += mirrored(naming, steps[0])
    if left < SIGNIFICANCE:
        notes.append(f"{share:.0%} of the mismatch is explained; the residuals are still not white.")
    verdict: Verdict = "named" if all(certain(step) for step in steps) else "ambiguous"
    return Judged(verdict, steps, p_value, notes)


def mirrored(naming: Naming, step: Step) -> list[str]:
    """Effects with the trace of the accepted one and the opposite sign: only the difference of the two is told."""
    scored = {candidate.label: candidate for candidate in naming.candidates}
    accepted = scored.get(step.label)
    if accepted is None:
        return []
    twins = [
        candidate.effect
        for candidate in naming.candidates
        if candidate.outcome == "of inadmissible sign"
        and abs(candidate.statistic / max(accepted.statistic, 1e-300) - 1.0) < _TWIN
    ]
    said = "leaves the same trace with the opposite sign: the recordings tell only the difference of the two."
    return [f"{twin} {said} {step.label} is what is left of it." for twin in twins]


def explained(baseline: Fit, improved: Fit) -> float:
    """The share of the baseline's squared residuals above the recordings' white noise that the improvement removes."""
    mask, samples = np.asarray(baseline.runs.mask), np.asarray(baseline.runs.samples())
    sigma = np.asarray(improved.sigma)
    noise = record_sigma(np.asarray(improved.model.error), mask)
    squares = lambda fit: float(np.sum((np.asarray(fit.model.error) / sigma) ** 2))
    floor = float(np.sum(samples * np.minimum(noise / sigma, 1.0) ** 2))
    above = squares(baseline) - floor
    return float(np.clip((squares(baseline) - squares(improved)) / above, 0.0, 1.0)) if above > 0.0 else 1.0


def channel_scaled(found: Fit, sigma: Array) -> dict[str, float]:
    """rms(error)/σ on the training runs with a common σ for baseline and improved."""
    return {c: found.rms[c] * float(found.sigma[i] / sigma[i]) for i, c in enumerate(found.vehicle.layout.channels)}


def _where(judged: Judged, baseline: Fit, path: Trajectory, field: Field, train: Sequence[Recording]) -> list[Location]:
    """Where the mismatch lies: what was named says best, else the missing force itself."""
    if judged.verdict == "none":
        return []
    if not judged.steps:
        return locations(field, baseline, path, train)
    last = judged.steps[-1].fit.vehicle.effects
    return locations(field, baseline, path, train, effect_share(baseline, path, last[-len(judged.steps) :]))


def _physics(step: Step, improved: Fit) -> Physics:
    """An accepted effect with its numbers from the final fit."""
    effect = next(e for e in improved.vehicle.effects if e.label == step.label)
    rivals = [Rival(rival.name, rival.label, probability) for rival, probability in step.rivals]
    return Physics(
        effect.name,
        effect.label,
        list(effect.where),
        effect.expression,
        step.probability,
        estimates(improved, effect.label, effect.symbols()),
        rivals,
    )


def summary(verdict: Verdict, physics: list[Physics], where: list[Location]) -> str:
    """The verdict in one sentence."""
    places = " and ".join(place.where for place in where[:2]) or "no equation"
    names = ", then ".join(found.effect for found in physics)
    if verdict == "none":
        return "The model explains the recordings: nothing significant is left in the residuals."
    if verdict == "named":
        return f"The model leaves out {names}, felt in {places}; with it the held-out runs fit better."
    if verdict == "ambiguous":
        rivals = sorted({rival.effect for found in physics for rival in found.rivals})
        return f"Something is missing in {places}: {names}, but these runs cannot tell it from {', '.join(rivals)}."
    return f"Something is missing in {places}, and nothing in the vocabulary explains it."
