"""What is selected by evidence along one filtered trajectory, and which rivals are fitted beside it."""

import numpy as np
from lacking_rig import CUBIC, DRAG, SPRING, labels, lacking


def test_all_that_is_missing_is_selected_and_its_collinear_rivals_are_to_be_fitted():
    """Claim: a drag and a spring, both surely; beside the drag the other law of damping is fitted, and no sensor."""
    _, found = lacking(-0.4, 1.0)
    named = {one.effect.label: one for one in found.naming.named}
    assert set(named) == {DRAG, SPRING}
    assert min(one.probability for one in named.values()) > 0.9
    assert labels(found, named[DRAG].collinear) == [CUBIC] and named[SPRING].collinear == []


def test_what_the_disturbance_stood_for_is_selected():
    """Claim: without the drag a disturbance of its size is estimated; beside it one of a fifth, with more evidence."""
    base, found = lacking(-0.4)
    evidence, (drag,) = found.selector.evidence, found.naming.named
    assert drag.effect.label == DRAG
    beside = found.naming.products.disturbance
    assert np.all(np.asarray(beside.force) < 0.2 * np.asarray(base.view.disturbance.force))
    under = evidence.products[0]
    assert under.disturbance is not beside
    assert found.naming.value > under.log_evidence(found.naming.columns) + 3.0
