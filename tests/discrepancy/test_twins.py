"""What is a twin of a name, to be fitted beside it, and what is a rival."""

import numpy as np
import pytest

from jaxsub.discrepancy.name import named_on, refitted
from jaxsub.discrepancy.selector import Scan, Selector
from jaxsub.effects.hull_damping import CubicDamping, QuadraticDamping


class Scanned(Selector):
    """What `named_on` asks of a selector, of candidates whose χ² are given, and the share left beside another."""

    def __init__(self, statistics, left=0.1, **effects):
        self.candidates, self.kept, self.freely = list(effects.values()), np.ones(len(effects)), set()
        one = np.array(statistics)
        seen = lambda statistic: Scan(0.5 * statistic, statistic, self.candidates, statistic > 0.0)
        self.scan = lambda others: seen(left * one if others else one)
        self.p_value = lambda index, scan: np.exp(-0.5 * scan.statistic[index])
        self.stand_in = lambda others, index: np.ones(len(effects), bool)


def test_what_acts_in_the_same_place_is_fitted_although_a_picture_finds_it_far_worse():
    """Claim: of two thirds of the χ² cubic damping in the same equation is a twin, in another it is none."""
    damping = {"named": QuadraticDamping("x", -0.5), "same": CubicDamping("x", -0.5), "other": CubicDamping("y", -0.5)}
    found = named_on(Scanned([600.0, 400.0, 400.0], **damping), [], 0)
    assert found.collinear == [1]
    assert named_on(Scanned([600.0, 200.0, 590.0], **damping), [], 0).collinear == [2]


def test_the_same_effect_elsewhere_is_fitted_and_is_no_rival():
    """Claim: drag of nearly the same χ² in another equation is a twin and shares the name's probability."""
    here, there, cubic = QuadraticDamping("x", -0.5), QuadraticDamping("y", -0.5), CubicDamping("y", -0.5)
    found = named_on(Scanned([600.0, 595.0, 400.0], here=here, there=there, cubic=cubic), [], 0)
    assert (found.collinear, found.probability) == ([1], pytest.approx(1.0))
    assert [rival.name for rival, _ in found.rivals] == ["cubic-damping"]
    assert refitted(found, [(there, -10.0), (here, -11.0)]).probability == pytest.approx(1.0)


def test_what_does_as_much_and_is_asked_for_still_is_no_twin():
    """Claim: of nearly the same χ² another effect is no twin and no rival where 70 % of it, by no chance, are left
    beside the first, unless a free run asked for that."""
    effects = {"here": QuadraticDamping("x", -0.5), "there": CubicDamping("y", -0.5)}
    other = Scanned([600.0, 595.0], left=0.7, **effects)
    assert (named_on(other, [], 0).collinear, named_on(other, [], 0).rivals) == ([], [])
    assert named_on(Scanned([6.0, 5.9], left=0.7, **effects), [], 0).rivals != []
    assert named_on(Scanned([600.0, 595.0], left=0.3, **effects), [], 0).collinear == [1]
    other.freely.add(0)
    assert named_on(other, [], 0).collinear == [1]
