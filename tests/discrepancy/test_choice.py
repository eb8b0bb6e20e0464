"""What is taken first, what stands beside its twins, and what is said of those that a fit was asked of."""

import functools
import sys
from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import pytest
from diagnosis_cases import recorded, wrong

from experiments.concealed_physics.generate import generate
from experiments.concealed_physics.plan import cases
from experiments.next_manoeuvre.cases import case
from jaxsub.cli.runs import load_runs
from jaxsub.discrepancy import diagnose
from jaxsub.discrepancy.acceptance import (
    CandidateModels,
    Examination,
    Model,
    ModelFitter,
    accept_jointly,
    accept_singly,
)
from jaxsub.discrepancy.cross_validation import Comparison, Gain
from jaxsub.discrepancy.model import are_significant, fit_with
from jaxsub.discrepancy.name import Named, refitted
from jaxsub.discrepancy.selector import Selector
from jaxsub.discrepancy.structure_search import reconsidered
from jaxsub.discrepancy.verdict import Judged
from jaxsub.discrepancy.view import look
from jaxsub.discrepancy.whiteness import RANDOM, Memory
from jaxsub.effects.actuators import ActuatorRateLimit
from jaxsub.effects.hull import HullAsymmetry
from jaxsub.effects.hull_damping import CubicDamping, QuadraticDamping
from jaxsub.effects.mechanisms import CoulombFriction
from jaxsub.effects.sensors import SensorScale
from jaxsub.estimate import Problem, SearchEnd, batch, evaluate, fit
from jaxsub.results import RESULTS
from jaxsub.vehicle import read_vehicle
from jaxsub.vehicle.catalogue import dsrv


@pytest.mark.long
def test_twins_that_a_linear_picture_confuses_are_told_apart_by_their_fits():
    """Claim: at one amplitude quadratic damping is named though a linear picture prefers cubic damping to it."""
    made = case("damping", 160.0)
    runs = [made.driven(made.record, seed) for seed in (101, 102, 103)]
    found, _ = diagnose(made.vehicle, runs[:2], runs[2:])
    assert found.verdict in ("named", "ambiguous")
    assert found.physics[0].effect == "quadratic-damping"
    assert "cubic-damping" in [rival.effect for rival in found.physics[0].rivals]


def test_probabilities_of_twins_are_those_of_their_fits_and_others_keep_theirs():
    """Claim: the share of a group is divided by evidence, and what was not fitted stays as it was."""
    quadratic, cubic, friction = QuadraticDamping("x", -0.5), CubicDamping("x", -0.5), CoulombFriction("x", 0.01)
    named = Named(3, quadratic, 0.2, [(cubic, 0.6), (friction, 0.2)], [4])
    found = refitted(named, [(quadratic, -100.0), (cubic, -100.0 - np.log(3.0))])
    assert found.probability == pytest.approx(0.6)
    assert {effect.name: p for effect, p in found.rivals} == pytest.approx(
        {"cubic-damping": 0.2, "coulomb-friction": 0.2}
    )
    assert refitted(named, [(cubic, -1.0)]) == named


def astray(runs, share, *names):
    """A fit that ended with `share` of the file's numbers of those `names`."""
    values = wrong().values()
    sigma = jnp.array([output.sigma for output in wrong().layout.outputs])
    start = Problem.of(wrong(), runs, sigma).guess
    gone = wrong().with_values({name: share * values[name] for name in names})
    return evaluate(SearchEnd(gone, runs, start, sigma, jnp.asarray(1e6), jnp.asarray(0), RESULTS.successful))


@pytest.mark.long
def test_a_fit_that_went_astray_is_looked_at_from_the_file_too():
    """Claim: from numbers that a fit might have run away to, with their signs turned, the file's lead back."""
    gone = astray(batch(wrong(), recorded(None, 2)[:2]), -20.0, "Z_q", "M_w")
    assert max(gone.rms.values()) > 2.0
    found = look(gone, near=wrong()).vehicle.values()
    for row in wrong().layout.free:
        assert float(found[row.name]) == pytest.approx(float(dsrv().values()[row.name]), rel=0.2), row.name


@pytest.mark.long
def test_a_fit_with_more_effects_is_sought_from_the_file_too():
    """Claim: where a fit went astray its own numbers do not lead to the effect that it lacked, and the file's do."""
    runs = batch(wrong(), recorded(SensorScale("q", 0.05), 2)[:2])
    gone = astray(runs, -1.0, "M_delta_s", "M_q", "M_w")
    view, effects = look(gone), [SensorScale("q", 0.02)]
    assert max(fit_with(view, gone, effects, gone.vehicle).rms.values()) > 2.0
    found = fit_with(view, gone, effects, wrong())
    assert max(found.rms.values()) < 1.1
    assert float(found.vehicle.values()["sensor-scale[q].scale"]) == pytest.approx(0.05, rel=0.2)


@pytest.mark.long
def test_a_late_heading_does_not_lead_where_no_velocity_is_logged(tmp_path):
    """Claim: a heading that is 3 s late is named, though forces that follow it would explain it too."""
    late = cases("no_velocity", 3)[2]
    assert late.concealed == ("nps/sensor-delay[psi]",)
    assert generate(late, tmp_path)["reached"] == [pytest.approx(10.0, rel=1e-3)]
    vehicle = read_vehicle(tmp_path / "vehicle.toml")
    runs = load_runs(sorted(tmp_path.glob("run*.csv")), vehicle)
    found, _ = diagnose(vehicle, runs[:-1], runs[-1:])
    assert (found.verdict, [physics.label for physics in found.physics]) == ("named", ["sensor-delay[psi]"])


def test_what_is_there_is_told_and_what_is_not_is_not():
    """Claim: beside a sensor's scale error that was concealed, an asymmetry that was not is not told from nothing."""
    scale, asymmetry = SensorScale("q", 0.02), HullAsymmetry("pitch", 0.1)
    runs = batch(wrong(), recorded(SensorScale("q", 0.05), 1)[:2])
    view = look(fit(wrong().with_effect(scale).with_effect(asymmetry), runs))
    assert are_significant(view, [scale])
    assert not are_significant(view, [asymmetry])
    assert not are_significant(view, [scale, asymmetry])


@pytest.mark.long
@pytest.mark.parametrize("rate", [1e30, 1e261])
def test_a_limit_that_nothing_reaches_is_not_told(rate):
    """Claim: a rate limit far beyond all commands changes nothing, and so its size says nothing for it."""
    limit = ActuatorRateLimit(dsrv().layout.inputs[0][0], rate)
    runs = batch(wrong(), recorded(None, 1)[:2])
    assert not are_significant(look(fit(wrong().with_effect(limit), runs)), [limit])


class Fitted(CandidateModels):
    """A candidate 0 and its twins 1, 2 and 3: the evidence of their fits, and which are accepted.

    2 has a sign that physics forbids, and 3 is not told.
    """

    def __init__(self, *asked):
        self.values, self.asked = {(0,): 30.0, (1,): 20.0, (2,): -np.inf, (3,): 31.0}, asked
        self.found = SimpleNamespace(selector=None)

    def model(self, numbers):
        return SimpleNamespace(predicted=None)

    def is_significant(self, numbers):
        return numbers[0] in (0, 1)

    def accepts(self, fewer, more):
        assert self.is_significant([more])
        return more in self.asked


def test_a_twin_that_is_rejected_gives_way_to_the_next(monkeypatch):
    """Claim: the most probable that stands is taken, what was refused before is no rival, what is not told is one."""
    path = sys.modules["jaxsub.discrepancy.acceptance"]
    monkeypatch.setattr(path, "named_on", lambda *_: SimpleNamespace(collinear=[1, 2, 3]))
    monkeypatch.setattr(path, "robust_log_evidence", lambda evidence, predicted: evidence)
    untold = [(3, 31.0), (2, -np.inf)]
    assert accept_singly(Fitted(), [0]) == {}
    assert accept_singly(Fitted(1), [0]) == {1: [(1, 20.0), *untold]}
    assert accept_singly(Fitted(0, 1), [0]) == {0: [(0, 30.0), (1, 20.0), *untold]}


@pytest.mark.parametrize("admitted", [True, False])
def test_a_fit_that_physics_admits_has_evidence_whether_it_is_told_or_not(monkeypatch, admitted):
    """Claim: what is not told from nothing has the evidence of its fit, and what physics forbids has none."""
    path = sys.modules["jaxsub.discrepancy.acceptance"]
    for name, answer in (("evidence_of", 7.0), ("are_significant", False), ("is_admissible", admitted)):
        monkeypatch.setattr(path, name, lambda *_, answer=answer: answer)
    models = object.__new__(CandidateModels)
    models.found = SimpleNamespace(naming=SimpleNamespace(products=SimpleNamespace(disturbance=None)))
    models.by_numbers, models.values = {(0,): Model(None, None, None, ())}, {}
    assert not models.is_significant([0])
    assert models.log_evidence([0]) == (7.0 if admitted else -np.inf)


class Sets(CandidateModels):
    """Candidates of which one set is the truth: the others are not told, nor are two that trade, nor do fewer help."""

    def __init__(self, truth, trading=()):
        self.truth, self.trading, self.fitted = truth, {*trading}, []

    def insignificant(self, numbers):
        self.fitted.append(sorted(numbers))
        untold = {*numbers} - self.truth | (self.trading if self.trading <= {*numbers} else set())
        return sorted(untold, reverse=True)

    def alternatives(self, others, index):
        return [(index, 0.0)]

    def comparison(self, fewer, more):
        chance = 0.001 if self.truth <= {*more} else 1.0
        return Comparison(Gain(9.0, chance, 1.0), Gain(9.0, chance, 1.0), 0.5, True)

    def accepts(self, fewer, more):
        return more in self.truth


def test_of_several_those_that_no_fit_bears_out_are_left_out():
    """Claim: two of four that are there are kept after a second fit, one of two that trade, and none of none."""
    models = Sets({0, 3})
    assert accept_jointly(models, [0, 1, 2, 3]) == {0: [(0, 0.0)], 3: [(3, 0.0)]}
    assert models.fitted == [[0, 1, 2, 3], [0, 3]]
    models = Sets({0}, trading=(0, 1))
    assert set(accept_jointly(models, [0, 1])) == {0}
    assert models.fitted == [[0, 1], [0]]
    assert accept_jointly(Sets({0, 5}), [0, 1]) == {}


def looked(naming, pattern=None, memory=RANDOM):
    """A look at recordings of which only what was named, the force without a name and what is left matter."""
    found = object.__new__(Examination)
    parts = {"naming": naming, "pattern": pattern, "memory": memory, "view": None, "selector": None}
    for name, value in parts.items():
        object.__setattr__(found, name, value)
    return found


def silent():
    """A fitter of which only the progress is asked."""
    fitter = object.__new__(ModelFitter)
    object.__setattr__(fitter, "progress", lambda message: None)
    return fitter


class Asked:
    """Looks at recordings of which the answers are given, each a refusal or what stands; what was asked is counted.

    `ahead` is what is said of what comes next, and `result` how the baseline's fit ended.
    """

    def __init__(self, monkeypatch, *answers, ahead=None, result=RESULTS.successful):
        self.answers, self.tried, self.selector, self.ahead = [*answers], 0, object.__new__(Selector), []
        self.result = result
        path = sys.modules["jaxsub.discrepancy.structure_search"]

        def next_asked(fitter, base, vocabulary):
            self.ahead.append(self.tried)
            return None if ahead is None else (base, ahead)

        fakes = {
            "judge": lambda *_: Judged("named", [], 1e-9, []),
            "proposed_effects": lambda found, judged: [0] if self.answers else [],
            "accept_proposed": self.try_one,
            "weighed": lambda *_: self.found(),
            "stepwise_by_innovations": next_asked,
        }
        for name, fake in fakes.items():
            monkeypatch.setattr(path, name, fake)
        self.search = path.search_structure

    def found(self):
        found = looked(SimpleNamespace(named=[0], again=False))
        object.__setattr__(found, "selector", self.selector)
        return found

    def try_one(self, fitter, best, found, chosen, judged):
        self.tried += 1
        return best, self.answers.pop(0)

    def answer(self):
        """What is said, and whether there is something left to describe."""
        fit = SimpleNamespace(converged=bool(self.result == RESULTS.successful))
        _, said, left = self.search(silent(), Model(fit, None, None, ()), self.found(), None)
        return said, left is not None


def test_others_are_asked_where_all_that_was_named_is_refused(monkeypatch):
    """Claim: what stands after a refusal is named, refusals and all; after three what is left is to be described."""
    refused = Judged("unknown", [], 1e-9, ["refused"])
    damping = Named(0, QuadraticDamping("x", -0.5), 1.0, [], [])
    asked = Asked(monkeypatch, refused, Judged("named", [damping], 1e-9, ["stands"]))
    answer, left = asked.answer()
    assert (answer.verdict, answer.named, answer.notes) == ("named", [damping], ["refused", "stands"])
    assert (asked.tried, left) == (2, False)
    asked = Asked(monkeypatch, *[refused] * 5)
    answer, left = asked.answer()
    assert (answer.verdict, asked.tried, left) == ("unknown", 3, True)


def test_what_comes_next_is_asked_once_where_all_that_was_named_is_refused(monkeypatch):
    """Claim: after the first refusal, or before all where the baseline's fit did not arrive, and never again."""
    refused, luck = Judged("unknown", [], 1e-9, ["refused"]), Judged("none", [], 1e-3, ["refused too"])
    drag = Named(0, QuadraticDamping("x", -0.5), 1.0, [], [])
    stands = Judged("named", [drag], 1e-9, ["stands"])
    asked = Asked(monkeypatch, refused, ahead=stands)
    answer, left = asked.answer()
    assert (answer.named, answer.notes, asked.ahead, left) == ([drag], ["refused", "stands"], [1], False)
    asked = Asked(monkeypatch, ahead=stands, result=RESULTS.nonlinear_max_steps_reached)
    assert (asked.answer()[0].named, asked.tried, asked.ahead) == ([drag], 0, [0])
    for result, when in ((RESULTS.successful, [1]), (RESULTS.nonlinear_max_steps_reached, [0])):
        asked = Asked(monkeypatch, refused, luck, result=result)
        assert (asked.answer()[0].verdict, asked.tried, asked.ahead) == ("unknown", 2, when)


def test_what_is_beyond_doubt_stays_unknown_where_the_rest_says_nothing(monkeypatch):
    """Claim: a mismatch whose only candidates were refused is not called none."""
    nothing = Judged("none", [], 1.0, [])
    asked = Asked(monkeypatch, Judged("unknown", [], 1e-9, ["refused"]), nothing)
    answer, left = asked.answer()
    assert (answer.verdict, answer.p_value, left) == ("unknown", 1e-9, True)


def fitted_to(monkeypatch, model, said, after, asked):
    """Every trial ends at `model` with what is `said`, and a look there sees `after`; what was asked is kept."""

    def stand(fitter, base, found, chosen, judged):
        asked.append(chosen)
        return model, said

    path = sys.modules["jaxsub.discrepancy.structure_search"]
    monkeypatch.setattr(path, "accept_proposed", stand)
    monkeypatch.setattr(path, "examine", lambda *_: after)
    return path


@pytest.mark.parametrize(("left_in", "stands"), [("roll", False), ("yaw", True), (None, True)])
def test_a_name_stands_after_all_where_its_fit_leaves_no_force_in_its_place(monkeypatch, left_in, stands):
    """Claim: a name that a force without one seemed to beat is tried, and stays if no such force is left there."""
    force = lambda place: SimpleNamespace(significant=True, force=SimpleNamespace(equation=place)) if place else None
    seen = lambda place, *named: looked(SimpleNamespace(named=[*named]), force(place))
    yaw = Named(3, CubicDamping("yaw", -0.5), 1.0, [], [])
    roll = Named(7, CubicDamping("roll", -0.5), 1.0, [], [])
    base, better = Model(None, None, None, ()), Model(None, None, None, (roll.effect,))
    unknown, named = Judged("unknown", [], 1e-9, []), Judged("named", [roll], 1e-9, [])
    asked, after = [], seen(left_in)

    path = fitted_to(monkeypatch, better, named, after, asked)
    monkeypatch.setattr(path, "evidence_of", lambda view: 0.0)
    fitter = silent()
    found = reconsidered(fitter, base, seen("roll", yaw, roll), unknown, None)
    assert asked == [[7]]
    assert found == ((better, named, after) if stands else (base, unknown, None))
    assert reconsidered(fitter, base, seen("surge", yaw, roll), unknown, None) == (base, unknown, None)
    assert reconsidered(fitter, base, seen(None, yaw, roll), unknown, None) == (base, unknown, None)
    assert asked == [[7]]


@pytest.mark.parametrize(
    ("share", "left", "stands"),
    [
        (0.7, Memory(0.4, 0.0, 60.0), True),
        (0.7, Memory(1e-9, 0.0, 60.0), True),
        (0.7, Memory(1e-9, 0.0, 500.0), False),
        (0.4, RANDOM, None),
    ],
)
def test_names_that_say_most_by_a_linear_picture_are_asked_by_their_fit(monkeypatch, share, left, stands):
    """Claim: with 70 % they are fitted, and stand if the fit explains three quarters; with 40 % nothing is fitted."""
    delay, scale = (Named(i, SensorScale("psi", 0.1 * i), 1.0, [], []) for i in (3, 7))
    base, better = Model(None, None, None, ()), Model(None, None, None, (delay.effect,))
    unknown, named = Judged("unknown", [], 1e-9, []), Judged("named", [delay], 1e-9, [])
    asked, after = [], looked(SimpleNamespace(named=[]), None, left)

    path = fitted_to(monkeypatch, better, named, after, asked)
    evidence = iter([500.0, 0.0])
    monkeypatch.setattr(path, "evidence_of", lambda view: next(evidence))
    first = looked(SimpleNamespace(named=[delay, scale]), None, Memory(1e-9, share, 900.0))
    model, said, found = reconsidered(silent(), base, first, unknown, None)
    assert asked == ([] if stands is None else [[3, 7]])
    assert (model, found) == ((better, after) if stands else (base, None))
    assert said.named == ([delay] if stands else [])


def test_a_fit_of_fewer_effects_begins_also_where_that_of_more_ended():
    """Claim: at the best vehicle with all of them and others, less the others; at none where no fit had them all."""
    drag, lift, scale = QuadraticDamping("sway", -1.0), CubicDamping("yaw", -1.0), SensorScale("psi", 0.1)
    models = object.__new__(CandidateModels)
    models.found = looked(None)
    object.__setattr__(models.found, "selector", SimpleNamespace(candidates=[drag, lift, scale]))
    of = lambda cost, *effects: SimpleNamespace(fit=SimpleNamespace(cost=cost, vehicle=with_all(effects)))
    with_all = lambda effects: functools.reduce(lambda vehicle, effect: vehicle.with_effect(effect), effects, dsrv())
    models.by_numbers = {(): of(9.0), (0, 1): of(5.0, drag, lift), (0, 1, 2): of(2.0, drag, lift, scale)}
    assert [[effect.label for effect in near.effects] for near in models._near((0,))] == [[drag.label]]
    assert models._near((0,))[0].effects[0] is models.by_numbers[0, 1, 2].fit.vehicle.effects[0]
    assert [effect.label for effect in models._near((1, 2))[0].effects] == [lift.label, scale.label]
    assert models._near((0, 1, 2)) == []
    assert models._near(()) == []
