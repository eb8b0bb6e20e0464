"""Verdicts follow from the noise, the excitation and the equivalent systems, and holding what they name helps."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from lateral import lateral
from rigs import driven, oscillator, stacked

from jaxsub.estimate import SearchEnd, evaluate
from jaxsub.information import estimates, identifiability, identifiable_subset
from jaxsub.results import RESULTS
from jaxsub.simulation import synthetic

INERTIAL = {"I_x": 1.0, "D_x": 0.6, "K_x": 4.0, "B_x_drive": 2.0}


def at_truth(vehicle, noisier=1.0, still=()):
    """The fit that recordings of `vehicle` would give without their noise, the input columns `still` left at zero."""
    inputs = [driven(vehicle, 0.2 * np.arange(100), seed=s, amplitude=0.3) for s in (1, 2)]
    rest = lambda run: {n: 0.0 * c if n in still else c for n, c in run.columns.items()}
    inputs = [dataclasses.replace(run, columns=rest(run)) for run in inputs]
    runs = stacked(vehicle, synthetic(vehicle, inputs, seed=1, noise=False))
    layout = vehicle.layout
    start = jnp.zeros((2, len(layout.equations) + len(layout.positions)))
    sigma = noisier * jnp.array([output.sigma for output in layout.outputs])
    return evaluate(SearchEnd(vehicle, runs, start, sigma, jnp.asarray(0.0), jnp.asarray(0), RESULTS.successful))


@pytest.fixture(scope="module")
def scaled():
    """An oscillator whose every term is free, so that its equation may be multiplied by any number."""
    return at_truth(oscillator(coefficients=INERTIAL | {"F_x": "K_x / 40"}))


def test_equation_that_may_be_multiplied_leaves_one_direction_open_and_says_so(scaled):
    said = identifiability(scaled)
    assert (said.rank, said.parameters) == (3, 4)
    assert said.uncertainty[0] == np.inf
    (direction,) = said.null_directions
    np.testing.assert_allclose(list(direction.values()), [0.5] * 4, atol=2e-3)
    assert [family.leading for family in said.families] == ["T[x,x]"]
    for verdict in said.verdicts:
        assert (verdict.kind, verdict.structural) == ("only in combination", True)
        assert set(verdict.partners) == set(INERTIAL) - {verdict.name}
        assert "no input" in verdict.remedy
    assert len(said.sentences()) == 1 + 1 + 4 + 1


def test_number_that_follows_from_an_open_one_is_open(scaled):
    (tied,) = identifiability(scaled).tied
    assert (tied.name, tied.kind, tied.partners) == ("F_x", "left open by its expression", ("K_x",))
    assert tied.relative_error == np.inf and tied.remedy.startswith("it needs K_x to smaller errors")
    assert {e.name: e.standard_error for e in estimates(scaled, identifiability(scaled), None)}["F_x"] is None


def test_holding_the_subset_identifies_the_rest_and_it_is_the_inertia(scaled):
    assert identifiable_subset(scaled) == ("I_x",)
    tied = {"I_x": {"value": 1.0, "fixed": True}, "F_x": "D_x * K_x / 40"}
    fixed = at_truth(oscillator(coefficients=INERTIAL | tied))
    said = identifiability(fixed)
    assert said.rank == said.parameters == 3
    assert [verdict.kind for verdict in said.verdicts] == ["identified"] * 3
    assert identifiable_subset(fixed) == ()
    # the same numbers as the covariance of the fit, by another way
    expected = [fixed.standard_errors[name] / INERTIAL[name] for name in fixed.names]
    np.testing.assert_allclose([verdict.relative_error for verdict in said.verdicts], expected, rtol=1e-6)
    # of a product of two, by their covariance and its derivatives by hand
    slope = np.array([{"D_x": 4.0, "K_x": 0.6}.get(name, 0.0) for name in fixed.names]) / 40.0
    error = np.sqrt(slope @ np.asarray(fixed.covariance) @ slope)
    own = {estimate.name: estimate for estimate in estimates(fixed, said, None)}["F_x"]
    assert (own.value, own.standard_error_white) == pytest.approx((0.06, error), rel=1e-9)
    assert said.tied[0].kind == "identified"
    assert said.tied[0].relative_error == pytest.approx(error / 0.06, rel=1e-6)


def test_prior_on_one_of_the_combination_identifies_all():
    said = identifiability(at_truth(oscillator(coefficients=INERTIAL | {"I_x": {"value": 1.0, "prior_std": 0.1}})))
    assert said.rank == 4
    assert [verdict.kind for verdict in said.verdicts] == ["identified"] * 4


def test_input_that_does_not_move_is_named():
    verdicts = {v.name: v for v in identifiability(at_truth(oscillator(), still=("f",))).verdicts}
    assert verdicts["B_x_drive"].kind == "not excited"
    assert not verdicts["B_x_drive"].structural
    assert verdicts["B_x_drive"].remedy.endswith("move drive more")


def test_threshold_is_the_noise():
    vehicle = oscillator()
    quiet = identifiability(at_truth(vehicle))
    assert quiet.rank == 3
    worst = max(quiet.verdicts, key=lambda verdict: verdict.relative_error)
    # noise of any size scales what is known; half the coefficient's size is the limit
    almost, beyond = (at_truth(vehicle, noisier=factor * 0.5 / worst.relative_error) for factor in (0.6, 1.3))
    kind = lambda fit: {v.name: v.kind for v in identifiability(fit).verdicts}[worst.name]
    assert kind(almost) == "identified"
    assert kind(beyond) != "identified"


def test_roll_that_only_the_rudder_moved_asks_for_the_elevators_against_each_other():
    vehicle = lateral("v p r phi psi", "Y_p Y_v K_p N_p N_r")
    verdicts = {v.name: v for v in identifiability(at_truth(vehicle, still=("delta_er", "delta_el"))).verdicts}
    assert verdicts["N_r"].kind == "identified"
    assert verdicts["Y_p"].kind != "identified"
    assert verdicts["Y_p"].remedy.endswith("excite p: move elevator_right against elevator_left")


def test_fit_without_free_coefficients_has_nothing_to_say():
    fixed = {name: {"value": value, "fixed": True} for name, value in INERTIAL.items()}
    fit = at_truth(oscillator(coefficients=fixed))
    assert identifiability(fit).sentences() == ["The recordings determine 0 of 0 directions of the free coefficients."]
    assert identifiable_subset(fit) == ()
