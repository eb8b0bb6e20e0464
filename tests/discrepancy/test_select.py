"""Which candidates get a disturbance of their own before nothing is said to be missing."""

from types import SimpleNamespace

import numpy as np
import pytest

from jaxsub.discrepancy.name import select
from jaxsub.discrepancy.selector import Scan, Selector
from jaxsub.effects.hull_damping import CubicDamping

LAST = 4


class Slow(Selector):
    """Five candidates that gain nothing at the disturbance there is. The last leads under less of it, and under the
    disturbance that it leaves it gains `own`."""

    def __init__(self, own):
        self.own, self.candidates = own, [CubicDamping(place, -1.0) for place in "abcde"]
        self.usable, self.freely, self.estimated = np.ones(5, bool), set(), set()
        self.evidence = SimpleNamespace(given=["all", "a tenth", "hardly any"])

    def value(self, chosen):
        return self.own if LAST in chosen else 0.0

    def scan(self, chosen, under=None):
        value = np.array([-1.0, -1.5, -2.0, -2.5, -3.0])
        if under is not None:
            value[LAST] = 100.0
        elif (LAST,) in self.estimated:
            value[LAST] = self.own
        value = np.full(5, -9.0) if chosen else value
        return Scan(value, np.where(value > 0.0, 40.0, 0.0), self.candidates, np.ones(5, bool))

    def estimate(self, chosen):
        self.estimated.add(tuple(sorted(chosen)))

    def foremost(self, chosen, scan):
        return int(np.argmax(scan.value))

    def p_value(self, index, scan):
        return float(np.exp(-scan.statistic[index]))

    def predicts(self, chosen, more):
        return True


@pytest.mark.parametrize(("own", "chosen"), [(9.0, [LAST]), (-2.9, [])])
def test_what_was_put_down_to_a_disturbance_is_found(own, chosen):
    """Claim: what leads under a tenth of the disturbance alone is chosen if it gains under what it leaves of it."""
    selector = Slow(own)
    assert select(selector, lambda message: None)[0] == chosen
    assert (LAST,) in selector.estimated
