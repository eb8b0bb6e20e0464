"""The whole path: fit, locate, name, model, show."""

import dataclasses
from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np

from ..effects import FORCE_UNITS, AbstractEffect, numbers, with_numbers
from ..errors import InputError
from ..estimate import Solution, batch, fit
from ..findings import Finding
from ..recording import Recording
from ..results import RESULTS
from ..vehicle import AbstractVehicle, vehicle_findings
from . import settings
from .accept.acceptance import Examination, Model, ModelFitter, fitted_model
from .accept.model import with_coloured_errors
from .accept.verdict import Judged
from .explain.advice import next_manoeuvre
from .explain.consistency import consistent
from .explain.effect_forces import effect_forces
from .explain.evaluation import overlays
from .explain.kinds import leading, missing, right
from .explain.locate import Field, effect_shares, locations, shares, traces
from .explain.process_noise import noise_note, noise_signals
from .explain.show import channel_quality, coefficients, estimates, replaced, run_quality, trades
from .explain.shown import shown_on
from .explain.summary import summary
from .explain.validation import beyond_noise
from .linearise.priors import with_priors_of, with_wide_priors
from .linearise.view import View, look
from .propose.name import Named
from .records.diagnosis import Candidate, Conclusions, ForceTrace, Location, Physics, Rival
from .records.progress import Progress, limited
from .search.examine import examine
from .search.innovation_models import segmented
from .search.structure_search import search_structure
from .search.surrogate import with_surrogate

# most rivals of an effect that are listed, and the posterior probability above which they are
_LISTED, _LISTED_PROBABILITY = 4, 0.02
# rms of a filtered disturbance force over its estimated standard deviation above which it is reported
_REPORTED_DISTURBANCE = 0.3

# receives each answer before the last: the diagnosis, which is not `complete`, and the improved vehicle
Keep = Callable[[Conclusions, AbstractVehicle], object]


def diagnose(
    vehicle: AbstractVehicle,
    train: Sequence[Recording],
    test: Sequence[Recording],
    *,
    vocabulary: tuple[type[AbstractEffect], ...] | None = None,
    progress: Progress = lambda message: None,
    budget: float | None = None,
    stop: Callable[[], bool] = lambda: False,
    keep: Keep = lambda diagnosis, improved: None,
    begin: Sequence[AbstractEffect] = (),
) -> tuple[Conclusions, AbstractVehicle]:
    """What physics `vehicle` leaves out according to the runs `train`, shown on the runs `test`.

    Nothing of the runs `test` takes part in a decision: the models are simulated along them once, at the end. Returns
    the diagnosis and the improved vehicle; `vocabulary` is all that is installed by default; `progress` receives what
    is being done. After `budget` seconds, or once `stop()` is true, no further effect is tried, and the answer so far
    is given, which then is not `complete`. Each answer on the way is given to `keep`: one more effect was accepted, and
    the test runs were not looked at yet. Effects to `begin` with, as of an earlier answer, come before any other, if
    they are accepted together. **Raises** `InputError` where the recordings lack a column, the model does not run from
    the vehicle file's values or diverges along the recordings, or `begin` has effects that are no candidates.
    """
    until = limited(progress, budget, stop)
    progress("fitting the baseline")
    file = with_wide_priors(vehicle)
    start = fit(file, batch(file, train).padded())
    if RESULTS[start.result] == RESULTS[RESULTS.nan_start]:
        remedy = "give coefficients that are closer, or a bound on the one that makes it unstable"
        raise InputError(vehicle.layout.name, "the model does not run from its starting values", remedy)
    progress("following the recordings")
    view = look(start, near=file)
    if not view.finite:
        remedy = "bound the coefficient that makes it unstable, or sample more often"
        raise InputError(vehicle.layout.name, "the model diverges in a filter of the recordings", remedy)
    found = examine(view, vocabulary, progress)
    signals = noise_signals(start, train)
    field = Field(shares(found.view, found.naming.first), traces(found.view, train), signals)
    fitter, baseline = ModelFitter(until, file), fitted_model(start, found.view, ())
    account = _Account(vehicle, train, found, field, baseline)
    so_far = lambda model, judged: keep(*account.of(model, model, judged, ()))
    named, judged, left = search_structure(fitter, baseline, found, vocabulary, so_far, begin)
    best, judged = (named, judged) if left is None else with_surrogate(fitter, named, left, judged, vocabulary)
    if best.pieces > 1:
        account = dataclasses.replace(account, baseline=segmented(baseline, best.pieces))
    progress("simulating the test runs")
    return account.of(named, best, judged, test)


@dataclasses.dataclass(frozen=True)
class _Account:
    """How an answer is put together: the vehicle, its training runs, the first look at them, and the baseline."""

    vehicle: AbstractVehicle
    train: Sequence[Recording]
    first: Examination
    field: Field
    baseline: Model

    @cached_property
    def start(self) -> Solution:
        """The baseline's fit, with errors that allow for its disturbance: the same in every answer."""
        return with_coloured_errors(self.baseline.view, self.baseline.fit)

    def of(
        self, named: Model, best: Model, judged: Judged, test: Sequence[Recording]
    ) -> tuple[Conclusions, AbstractVehicle]:
        """The diagnosis, and the improved vehicle: the `best` model, of which the `named` one has the numbers of names.

        Without a `test` run nothing is shown of any.
        """
        vehicle, train, field, layout = self.vehicle, self.train, self.field, self.vehicle.layout
        start, baseline = self.start, self.baseline
        improved = with_coloured_errors(best.view, best.fit) if best.added else start
        sigma = np.asarray(start.sigma)
        standing = best.added[len(named.added) :]
        channels = channel_quality(improved)
        shown = shown_on(test, vehicle, train, [baseline, best] if best.added else [baseline], channels)
        if shown is not None:
            judged = consistent(judged, shown.explained, shown.low, shown.assessment)
        where = _where(judged, self.first, field, train)
        own = improved if named is best else with_coloured_errors(named.view, named.fit)
        physics = [_physics(one, own) for one in judged.named]
        given = [name for name, spread in vehicle.spreads.items() if float(spread) > 0.0]
        by_run = improved.varying([name for name in improved.vehicle.spreads if name not in given])
        found = None if shown is None else shown.explained
        diagnosis = Conclusions(
            verdict=judged.verdict,
            vehicle=layout.name,
            summary=summary(judged.verdict, physics, where, standing, found, judged.p_value),
            p_value=judged.p_value,
            where=where,
            physics=physics,
            fit={
                "train": {"baseline": start.rms, "improved": improved.rms},
                "held_out": {} if shown is None else {"baseline": shown.before.rms, "improved": shown.after.rms},
            },
            candidates=_became(self.first.naming.candidates, physics, standing),
            forces=field.traces,
            remaining_forces=self._remaining(best),
            overlays=[] if shown is None else overlays(test, layout.measured, shown.before, shown.after),
            coefficients=coefficients({k: float(v) for k, v in vehicle.values().items()}, start, improved),
            channels=channels,
            runs=[*run_quality(train, "train"), *run_quality(test, "held out")],
            notes=[
                *judged.notes,
                *_replaced_notes(start, improved),
                *disturbance_note(best.view),
                *noise_note(field.signals),
                *(one.sentence() for one in by_run),
                *([] if shown is None else beyond_noise(shown.left, shown.after.rms, layout)),
            ],
            next_manoeuvre=next_manoeuvre(judged.verdict, physics),
            kinds=missing(judged.named) if judged.named else leading(self.first),
            file_p_value=right(best.view, vehicle),
            remains={} if shown is None else shown.remains,
            gain=None if shown is None else shown.gain,
            history=[] if shown is None else shown.history(sigma),
            explanations=tuple(with_priors_of(vehicle, one) for one in _explanations(judged, improved.vehicle)),
            explained=found,
            findings=_findings(vehicle, [*train, *test]),
            decisions=judged.decisions,
            complete=judged.complete,
            by_run=list(by_run),
        )
        return diagnosis, with_priors_of(vehicle, improved.vehicle)

    def _remaining(self, best: Model) -> list[ForceTrace]:
        """What the best model lacks, and what its effects are; what the baseline lacks where it is the best."""
        if not best.added:
            return self.field.traces
        return traces(best.view, self.train, effect_forces(self.baseline.view, best.view, best.added))


def _findings(vehicle: AbstractVehicle, recordings: Sequence[Recording]) -> tuple[Finding, ...]:
    """What is odd about the vehicle, and what reading and checking the recordings found, of pieces of one run once."""
    of_runs = (finding for run in recordings for finding in run.findings)
    return tuple(dict.fromkeys([*vehicle_findings(vehicle, vehicle.layout.name), *of_runs]))


def _where(judged: Judged, found: Examination, field: Field, train: Sequence[Recording]) -> list[Location]:
    """The mismatch's places: where accepted effects act, or where the nonparametric force does, else as located."""
    if judged.verdict == "none":
        return []
    share, view = field.share, found.view
    if judged.named:
        effects = [one.effect for one in judged.named]
        share = effect_shares(view, effects, found.naming.products.disturbance)
    elif found.nonparametric is not None:
        share = {place: 0.5 * part for place, part in share.items()}
        share[found.nonparametric] = share.get(found.nonparametric, 0.0) + 0.5
    return locations(field, view, train, share)


def _became(
    candidates: Sequence[Candidate], physics: Sequence[Physics], standing: Sequence[AbstractEffect]
) -> list[Candidate]:
    """The candidates of the first look with what became in the end of those that stand and of their rivals."""
    became = {rival.label: "rival" for found in physics for rival in found.rivals}
    became |= {effect.label: "surrogate, its cause unclaimed" for effect in standing}
    became |= {found.label: "accepted" for found in physics}
    return [dataclasses.replace(one, outcome=became.get(one.label, one.outcome)) for one in candidates]


def _explanations(judged: Judged, improved: AbstractVehicle) -> tuple[AbstractVehicle, ...]:
    """The improved vehicle and those with a rival in the place of what is least certain; none where nothing is."""
    if judged.verdict != "ambiguous":
        return ()
    least = min(judged.named, key=lambda named: named.probability)
    without = improved.without_effect(least.effect.label)
    rivals = [rival for rival, _ in _listed(least)[: settings.ALTERNATIVES]]
    return (improved, *(without.with_effect(rival) for rival in rivals))


def _listed(named: Named) -> list[tuple[AbstractEffect, float]]:
    """The most probable rivals."""
    return [(rival, p) for rival, p in named.rivals if p > _LISTED_PROBABILITY][:_LISTED]


def _physics(named: Named, improved: Solution) -> Physics:
    """An accepted effect with its numbers from the final fit."""
    own = next((e for e in improved.vehicle.all_effects if e.label == named.effect.label), named.effect)
    effect = with_numbers(named.effect, numbers(own))
    rivals = [Rival(rival.name, rival.label, probability) for rival, probability in _listed(named)]
    return Physics(
        effect.name,
        effect.label,
        list(effect.where),
        effect.expression,
        named.probability,
        estimates(improved, effect),
        rivals,
        trades(improved, effect.label),
    )


def _replaced_notes(start: Solution, improved: Solution) -> list[str]:
    """A line for each of the baseline's coefficients that effects of the improved model replace."""
    by = lambda name: ", ".join(effect.label for effect in improved.vehicle.effects if name in effect.replaces)
    return [f"{name} is zero in the improved model: {by(name)} replaces it." for name in replaced(start, improved)]


def disturbance_note(view: View) -> list[str]:
    """One line: the remaining disturbance forces, where they are larger than their own smallest visible size."""
    layout, disturbance = view.vehicle.layout, view.disturbance
    total = np.asarray(view.followed.force).std(axis=(0, 1))
    # a mechanism's coordinate may be of any unit
    sized = lambda e, q: f"{float(q):.3g} {FORCE_UNITS.get(e, '')}".strip()
    forces = [
        f"{e} {sized(e, q)}, {float(t):.2g} s"
        for e, q, t, rms in zip(layout.equations, disturbance.force, disturbance.time, total, strict=True)
        if rms > _REPORTED_DISTURBANCE * float(q)
    ]
    whole = f"Random disturbance forces remain (standard deviation, correlation time): {'; '.join(forces)}."
    return [whole] if forces else []
