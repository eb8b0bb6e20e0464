"""How a model is led along its recordings, and which searches for its disturbance go on."""

import dataclasses
import math

import jax.numpy as jnp
import numpy as np
import pytest
from diagnosis_cases import recorded, wrong
from rigs import driven, oscillator

from jaxsub.discrepancy import innovation_search, view
from jaxsub.discrepancy.evidence import evidence_of
from jaxsub.discrepancy.view import look
from jaxsub.effects.hull import HullAsymmetry
from jaxsub.estimate import batch, fit
from jaxsub.simulation import synthetic


@pytest.fixture(scope="module")
def fitted():
    """A fit to recordings that conceal a force."""
    return fit(wrong(), batch(wrong(), recorded(HullAsymmetry("pitch", 3.0), 2)[:2]))


def led_to(times):
    """A search that ends at forces so many `times` larger than it began with."""
    return lambda system, columns, prior, start, **steps: dataclasses.replace(start, force=times * start.force)


def test_a_turn_leads_to_nothing_less_probable(fitted, monkeypatch):
    """Claim: a search for the disturbance that ends far off changes nothing; where half its way is right, half."""
    found = look(fitted)
    monkeypatch.setattr(innovation_search, "estimate_disturbance", led_to(1.0))
    still = evidence_of(look(fitted, found.disturbance))
    monkeypatch.setattr(innovation_search, "estimate_disturbance", led_to(1e8))
    assert evidence_of(look(fitted, found.disturbance)) > still - 0.5
    # a hundred times too large at first, and a step of ten thousand down: all of it is too far, half is right
    large = dataclasses.replace(found.disturbance, force=100.0 * found.disturbance.force)
    monkeypatch.setattr(view, "_guessed", lambda *given: large)
    monkeypatch.setattr(innovation_search, "estimate_disturbance", led_to(1e-4))
    half = look(fitted)
    assert float(half.disturbance.force[0] / found.disturbance.force[0]) == pytest.approx(1.0, rel=1e-6)


def test_runs_of_unequal_length_have_a_disturbance(fitted):
    """Claim: samples that are padded change nothing: the disturbance, numbers and likelihood are those without them."""
    padded = fitted.runs.padded()
    assert padded.times.shape[1] > fitted.runs.times.shape[1]
    found, same = (look(one) for one in (fitted, fit(wrong(), padded)))
    assert evidence_of(same) == pytest.approx(evidence_of(found), rel=1e-6)
    assert np.asarray(same.disturbance.force) == pytest.approx(np.asarray(found.disturbance.force), rel=1e-3)
    # it moved from where it began
    begun = view._guessed(fitted.model.whole, fitted.runs, fitted.sigma, fitted.problem.start_std)
    assert np.max(np.abs(np.log(found.disturbance.force / np.asarray(begun.force)))) > 0.1


def test_searches_that_agree_are_one():
    """Claim: of searches that came to the same cost one goes on; the order is by cost, those without one last."""

    def iterate(cost):
        made = object.__new__(innovation_search.Iterate)
        made.__dict__["cost"] = cost
        return made

    nan = float("nan")
    found = innovation_search.distinct(iterate(cost) for cost in (nan, 9.0, 3.0, 9.2, 3.1, nan))
    assert [one.cost for one in found[:2]] == [3.0, 9.0]
    assert all(one.cost != one.cost for one in found[2:])


@pytest.mark.parametrize(("costs", "turns"), [((9.0, 5.0, 4.9, 0.0), 2), ((math.nan, math.nan, math.nan), 1)])
def test_alternations_end_where_the_cost_stays_or_is_not_a_number(monkeypatch, costs, turns):
    """Claim: parameters and disturbance alternate while the cost falls, and once where it is no number."""

    def iterate(number):
        made = object.__new__(innovation_search.Iterate)
        made.__dict__.update(cost=costs[number], number=number)
        return made

    search = innovation_search.InnovationSearch
    monkeypatch.setattr(search, "alternated", lambda self, one: iterate(one.__dict__["number"] + 1))
    assert object.__new__(search).converged(iterate(0)).__dict__["number"] == turns


@pytest.mark.long
def test_numbers_that_the_recordings_do_not_tell_are_of_the_order_of_the_files():
    """Claim: undriven, the drive's gain stays where it was, to ten times it, or to the file's own spread."""
    still = driven(oscillator(), 0.1 * np.arange(100), 0, amplitude=0.0)
    start = jnp.asarray([[0.5, 0.0]])
    for given, spread in ((2.0, 20.0), ({"value": 2.0, "prior_std": 0.3}, 0.3)):
        vehicle = oscillator(coefficients={"D_x": 0.6, "K_x": 4.0, "B_x_drive": given})
        led = look(fit(vehicle, synthetic(vehicle, [still], seed=3, start=start)))
        at = [row.name for row in vehicle.layout.free].index("B_x_drive")
        assert float(led.vehicle.values()["B_x_drive"]) == pytest.approx(2.0)
        assert np.sqrt(led.covariance[at, at]) == pytest.approx(spread, rel=1e-3)


def test_a_step_is_the_least_within_its_bounds():
    """Claim: no point within bounds leaves less than the step, one that is only cut off at them leaves more, and
    without bounds it is that of the normal equations."""
    rng = np.random.default_rng(3)
    columns = rng.standard_normal((40, 4)) + 2.0 * rng.standard_normal((40, 1))
    gram = (whole := np.column_stack([columns @ [3.0, -2.0, 1.0, 0.5], columns])).T @ whole
    left = lambda step: step @ gram[1:, 1:] @ step - 2.0 * step @ gram[1:, 0]
    free = innovation_search._step(gram, 0.0, np.full(4, -np.inf), np.full(4, np.inf))
    assert free == pytest.approx([3.0, -2.0, 1.0, 0.5])
    low, high = np.full(4, -1.0), np.full(4, 1.0)
    step = innovation_search._step(gram, 0.0, low, high)
    assert np.all((step >= low) & (step <= high))
    assert left(step) < left(np.clip(free, low, high)) - 1.0
    assert all(left(step) <= left(point) for point in rng.uniform(low, high, (2000, 4)))
