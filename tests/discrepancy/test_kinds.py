"""The kind of mismatch is told, also before its name; and whether the numbers of the file are right beside it."""

import numpy as np
import pytest
from diagnosis_cases import disturbed, recorded, wrong

from jaxsub.discrepancy.accept.model import fit_with
from jaxsub.discrepancy.explain.kinds import leading, missing, right
from jaxsub.discrepancy.linearise.view import look
from jaxsub.discrepancy.propose.name import Named
from jaxsub.discrepancy.search.examine import examine
from jaxsub.effects import ActuatorLag, CrossflowDrag, Current, SensorScale
from jaxsub.estimate import batch, fit
from jaxsub.vehicle.catalogue import dsrv

KINDS = (CrossflowDrag, ActuatorLag, Current, SensorScale)
CONCEALED = {
    "structure": CrossflowDrag("vertical", 5.0, 0.761, 0.3),
    "actuator": ActuatorLag("stern_plane", 0.6),
    "sensor": SensorScale("q", 0.05),
}


def baseline(runs):
    return fit(wrong(), batch(wrong(), runs))


@pytest.mark.long
@pytest.mark.parametrize("kind", ["structure", "actuator", "sensor"])
def test_what_leads_is_of_the_kind_that_was_concealed(kind):
    """Claim: its probability is above 0.95; beside it the true numbers are not refused, and wrong ones are."""
    effect = CONCEALED[kind]
    start = baseline(recorded(effect, 5)[:2])
    view = look(start, near=wrong())
    found = examine(view, KINDS, lambda message: None)
    said = leading(found)
    assert next(iter(said)) == kind and said[kind] > 0.95
    assert np.isclose(sum(said.values()), 1.0)
    with_it = look(fit_with(view, start, [effect], wrong()))
    assert right(with_it, dsrv()) > 1e-3
    assert right(with_it, wrong()) < 1e-6


def test_several_accepted_effects_are_each_of_a_kind():
    """Claim: of a drag of 0.9 with a lag for its rival and a bias that is sure, all three kinds have their chance."""
    drag = Named(0, CONCEALED["structure"], 0.9, [(CONCEALED["actuator"], 0.1)], [])
    bias = Named(1, CONCEALED["sensor"], 1.0, [], [])
    assert list(missing([drag, bias]).items()) == [
        ("sensor", 1.0),
        ("structure", 0.9),
        ("actuator", pytest.approx(0.1)),
    ]


@pytest.mark.parametrize("disturbance", [None, (3.0, (0.5, 1.5), 3)], ids=["clean", "disturbed"])
def test_what_is_random_is_a_disturbance(disturbance):
    """Claim: noise and random forces alone are neither structure nor a device that errs."""
    runs = disturbed(*disturbance) if disturbance else recorded(None, 5)
    said = leading(examine(look(baseline(runs[:2])), KINDS, lambda message: None))
    assert next(iter(said)) == "disturbance" and said["disturbance"] > 0.5


@pytest.mark.long
def test_the_right_numbers_are_refused_as_often_as_stated():
    """Claim: of 30 records with random forces the true numbers' p-value is below 0.1 in at most 8, and not always high.

    8 or more of 30 have a chance of 1 % where one in ten is refused.
    """
    views = (look(baseline(disturbed(3.0, (0.5, 1.5), seed)[:2])) for seed in range(30))
    p_values = np.array([right(view, dsrv()) for view in views])
    assert np.sum(p_values < 0.1) <= 8
    assert np.sum(p_values < 0.5) >= 5
