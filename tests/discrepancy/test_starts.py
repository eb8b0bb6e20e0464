"""What fits and views of the DSRV start from, and what is significant in them."""

import jax.numpy as jnp
import numpy as np
import pytest
from diagnosis_cases import recorded, wrong

from experiments.concealed_physics.generate import generate
from experiments.concealed_physics.plan import cases
from experiments.next_manoeuvre.cases import case
from jaxsub.cli.runs import load_runs
from jaxsub.discrepancy import diagnose
from jaxsub.discrepancy.accept.model import are_significant, fit_with
from jaxsub.discrepancy.linearise.view import look
from jaxsub.discrepancy.propose.name import Named, refitted
from jaxsub.effects import (
    ActuatorRateLimit,
    CoulombFriction,
    CubicDamping,
    HullAsymmetry,
    QuadraticDamping,
    SensorScale,
)
from jaxsub.estimate import Problem, SearchEnd, batch, evaluate, fit
from jaxsub.results import RESULTS
from jaxsub.vehicle import read_vehicle
from jaxsub.vehicle.catalogue import dsrv


@pytest.mark.long
def test_rivals_that_linearisation_confuses_are_distinguished_by_their_fits():
    """Claim: at one amplitude quadratic damping is named though linearisation prefers cubic damping."""
    made = case("damping", 160.0)
    runs = [made.driven(made.record, seed) for seed in (101, 102, 103)]
    found, _ = diagnose(made.vehicle, runs[:2], runs[2:])
    assert found.verdict in ("named", "ambiguous")
    assert found.physics[0].effect == "quadratic-damping"
    assert "cubic-damping" in [rival.effect for rival in found.physics[0].rivals]


def test_probabilities_of_fitted_rivals_are_by_their_evidence_and_others_keep_theirs():
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
def test_a_fit_in_a_wrong_optimum_is_filtered_from_the_file_too():
    """Claim: from numbers that a fit might have run away to, with their signs turned, the file's lead back."""
    gone = astray(batch(wrong(), recorded(None, 2)[:2]), -20.0, "Z_q", "M_w")
    assert max(gone.rms.values()) > 2.0
    found = look(gone, near=wrong()).vehicle.values()
    for row in wrong().layout.free:
        assert float(found[row.name]) == pytest.approx(float(dsrv().values()[row.name]), rel=0.2), row.name


@pytest.mark.long
def test_a_fit_with_more_effects_is_sought_from_the_file_too():
    """Claim: from a wrong optimum a fit does not lead to the effect that it lacked, and from the file it does."""
    runs = batch(wrong(), recorded(SensorScale("q", 0.05), 2)[:2])
    gone = astray(runs, -1.0, "M_delta_s", "M_q", "M_w")
    view, effects = look(gone), [SensorScale("q", 0.02)]
    assert max(fit_with(view, gone, effects, gone.vehicle).rms.values()) > 2.0
    found = fit_with(view, gone, effects, wrong())
    assert max(found.rms.values()) < 1.1
    assert float(found.vehicle.values()["sensor-scale[q].scale"]) == pytest.approx(0.05, rel=0.2)


@pytest.mark.long
def test_a_late_heading_is_named_where_no_velocity_is_logged(tmp_path):
    """Claim: a heading that is 3 s late is named, though forces that follow it would explain it too."""
    late = cases("no_velocity", 3)[2]
    assert late.concealed == ("nps/sensor-delay[psi]",)
    assert generate(late, tmp_path)["reached"] == [pytest.approx(10.0, rel=1e-3)]
    vehicle = read_vehicle(tmp_path / "vehicle.toml")
    runs = load_runs(sorted(tmp_path.glob("run*.csv")), vehicle)
    found, _ = diagnose(vehicle, runs[:-1], runs[-1:])
    assert (found.verdict, [physics.label for physics in found.physics]) == ("named", ["sensor-delay[psi]"])


def test_a_concealed_effect_is_significant_and_an_absent_one_is_not():
    """Claim: beside a concealed scale error of a sensor, an asymmetry that was not concealed is not significant."""
    scale, asymmetry = SensorScale("q", 0.02), HullAsymmetry("pitch", 0.1)
    runs = batch(wrong(), recorded(SensorScale("q", 0.05), 1)[:2])
    view = look(fit(wrong().with_effect(scale).with_effect(asymmetry), runs))
    assert are_significant(view, [scale])
    assert not are_significant(view, [asymmetry])
    assert not are_significant(view, [scale, asymmetry])


@pytest.mark.long
@pytest.mark.parametrize("rate", [1e30, 1e261])
def test_a_limit_that_nothing_reaches_is_not_significant(rate):
    """Claim: a rate limit far beyond all commands changes nothing, however large it is."""
    limit = ActuatorRateLimit(dsrv().layout.inputs[0][0], rate)
    runs = batch(wrong(), recorded(None, 1)[:2])
    assert not are_significant(look(fit(wrong().with_effect(limit), runs)), [limit])
