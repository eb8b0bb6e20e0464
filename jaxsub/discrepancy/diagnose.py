"""The whole path: fit, locate, name, model, show."""

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Array

from ..effects import AbstractEffect, candidates
from ..errors import InputError
from ..estimate import Fit, fit
from ..likelihood import Disturbance
from ..recording import Recording
from ..recording.runs import Runs
from ..results import RESULTS
from ..vehicle import AbstractVehicle
from .advice import next_manoeuvre
from .batch import batch
from .columns import candidate_columns
from .diagnosis import Diagnosis, Location, Physics, Rival
from .evidence import Evidence
from .generic import Pattern, pattern
from .locate import Field, effect_shares, locations, shares, traces
from .model import allowing_for, join, sound
from .name import Named, Naming, Selector, name
from .process_noise import noise_note, noise_signals
from .progress import Progress
from .show import HeldOut, channel_quality, coefficients, estimates, hold, luck, overlays, run_quality
from .verdict import Judged, helped, judge, settled, summary
from .view import View, facts, look


@dataclasses.dataclass(frozen=True)
class Found:
    """What the vocabulary and an anonymous force say about the recordings from one view of them."""

    view: View
    naming: Naming
    pattern: Pattern | None


def diagnose(
    vehicle: AbstractVehicle,
    train: Sequence[Recording],
    held: Sequence[Recording],
    *,
    vocabulary: tuple[type[AbstractEffect], ...] | None = None,
    progress: Progress = lambda message: None,
) -> tuple[Diagnosis, AbstractVehicle]:
    """What physics `vehicle` leaves out according to the runs `train`, shown on the runs `held`.

    Returns the diagnosis and the improved vehicle; `vocabulary` is all that is installed by default; `progress` is told
    what is being done. **Raises** `InputError` where the recordings lack a column, or the model does not run from the
    vehicle file's values.
    """
    layout, size = vehicle.layout, len(train)
    runs = batch(vehicle, [*train, *held])
    seen, chosen = runs.take(range(size), size), range(size, size + len(held))
    progress("fitting the baseline")
    start = fit(vehicle, seen)
    if bool(start.result == RESULTS.nan_start):
        remedy = "give coefficients that are closer, or a bound on the one that makes it unstable"
        raise InputError(layout.name, "the model does not run from its starting values", remedy)
    progress("following the recordings")
    found = examine(look(start), vocabulary, progress)
    view, naming = found.view, found.naming
    signals = noise_signals(start, train)
    field = Field(shares(view, naming.first), traces(view, train), signals)
    progress("free runs through what the fit did not see")
    trial = Trial(runs, chosen, size, start.sigma, start)
    before = trial.held_out(start, view.disturbance)
    judged = judge(naming, found.pattern)
    added: list[AbstractEffect] = [named.effect for named in judged.named]
    if judged.verdict == "unknown" and found.pattern is not None and found.pattern.significant:
        added = [found.pattern.force]
    best = Model(start, view, before, ())
    # one after the other, since what fails on runs that were not fitted must not take with it what stands
    for effect in added:
        more = trial.with_effects(found, (*best.added, effect), progress)
        judged = helped(judged, effect, sound(more.fit, more.added), luck(best.shown, more.shown))
        if effect not in judged.refused:
            best = more
    judged = settled(judged)
    after, remaining = best.shown, best.view
    baseline = allowing_for(view, start)
    improved = allowing_for(remaining, best.fit) if best.added else baseline
    where = _where(judged, found, field, train)
    physics = [_physics(named, improved) for named in judged.named]
    diagnosis = Diagnosis(
        verdict=judged.verdict,
        vehicle=layout.name,
        summary=summary(judged.verdict, physics, where),
        p_value=judged.p_value,
        where=where,
        physics=physics,
        fit={
            "train": {"baseline": baseline.rms, "improved": improved.rms},
            "held_out": {"baseline": before.rms, "improved": after.rms},
        },
        candidates=naming.candidates,
        forces=field.traces,
        remaining_forces=field.traces if remaining is view else traces(remaining, train),
        overlays=overlays(held, layout.channels, before, after),
        coefficients=coefficients({k: float(v) for k, v in vehicle.values().items()}, baseline, improved),
        channels=channel_quality(improved),
        runs=[*run_quality(train, "train"), *run_quality(held, "held out")],
        notes=[*judged.notes, *disturbance_note(remaining), *noise_note(signals)],
        next_manoeuvre=next_manoeuvre(judged.verdict, physics),
        history=[
            (label, {c: rms * float(s) for (c, rms), s in zip(seen.rms.items(), start.sigma, strict=True)})
            for label, seen in [("baseline", before), *([("improved", after)] if improved is not baseline else [])]
        ],
    )
    return diagnosis, improved.vehicle


class Model(NamedTuple):
    """A fit, its view, what it shows on the held-out runs, and the effects that were added to the baseline."""

    fit: Fit
    view: View
    shown: HeldOut
    added: tuple[AbstractEffect, ...]


@dataclasses.dataclass(frozen=True)
class Trial:
    """The runs that no fit saw: numbers `chosen` of `runs`, of which the first `size` were fitted."""

    runs: Runs
    chosen: Sequence[int]
    size: int
    sigma: Array
    start: Fit

    def with_effects(self, found: Found, effects: tuple[AbstractEffect, ...], progress: Progress) -> Model:
        """The baseline with `effects`, fitted again and tried."""
        progress(f"fitting with {', '.join(effect.label for effect in effects)}")
        joined = join(found.view, self.start, effects)
        view = look(joined, found.naming.products.disturbance)
        return Model(joined, view, self.held_out(joined, view.disturbance), effects)

    def held_out(self, fit: Fit, disturbance: Disturbance) -> HeldOut:
        """A fit's vehicle on them."""
        return hold(fit.vehicle, self.runs, self.chosen, self.size, self.sigma, disturbance)


def examine(view: View, vocabulary: tuple[type[AbstractEffect], ...] | None, progress: Progress) -> Found:
    """Name what the recordings of a view ask for, and see whether a force without a name would say it better."""
    present = {effect.label for effect in view.vehicle.effects}
    tried = [effect for effect in candidates(facts(view), vocabulary) if effect.label not in present]
    columns, owners = candidate_columns(view, tried)
    evidence = Evidence.of(view, columns)
    naming = name(Selector(evidence, tried, owners), progress)
    progress("looking for forces without a name")
    asked: list[Disturbance] = [evidence.best([])[1].disturbance, naming.products.disturbance]
    return Found(view, naming, pattern(view, evidence, naming.columns, asked))


def _where(judged: Judged, found: Found, field: Field, train: Sequence[Recording]) -> list[Location]:
    """The mismatch's places: where accepted effects act, or where the force without a name does, else as located."""
    if judged.verdict == "none":
        return []
    share, view = field.share, found.view
    if judged.named:
        effects = [named.effect for named in judged.named]
        share = effect_shares(view, effects, found.naming.products.disturbance)
    elif found.pattern is not None and found.pattern.significant:
        own = found.pattern.force.equation
        share = {place: 0.5 * part for place, part in share.items()}
        share[own] = share.get(own, 0.0) + 0.5
    return locations(field, view, train, share)


def _physics(named: Named, improved: Fit) -> Physics:
    """An accepted effect with its numbers from the final fit."""
    effect = next((e for e in improved.vehicle.effects if e.label == named.effect.label), named.effect)
    rivals = [Rival(rival.name, rival.label, probability) for rival, probability in named.rivals]
    return Physics(
        effect.name,
        effect.label,
        list(effect.where),
        effect.expression,
        named.probability,
        estimates(improved, effect.label, effect.symbols()),
        rivals,
    )


def disturbance_note(view: View) -> list[str]:
    """One line: the forces that no model predicts, where they are larger than their own smallest visible size."""
    layout, disturbance = view.vehicle.layout, view.disturbance
    total = np.asarray(view.followed.force).std(axis=(0, 1))
    said = [
        f"{e} ({float(q):.3g} {'N' if e in ('surge', 'sway', 'heave') else 'N m'}, {float(t):.2g} s)"
        for e, q, t, rms in zip(layout.equations, disturbance.force, disturbance.time, total, strict=True)
        if rms > 0.3 * float(q)
    ]
    return [f"What is left looks like random forces in {', '.join(said)}."] if said else []
