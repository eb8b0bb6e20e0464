"""Which candidates are preferred since they explain the simulation error, and what may stand in their place."""

import sys
from types import SimpleNamespace

import numpy as np
import pytest

from jaxsub.discrepancy.acceptance import Examination, proposed_effects
from jaxsub.discrepancy.selector import Scan, Selector
from jaxsub.discrepancy.verdict import Judged


class Simulated(Selector):
    """A selector of candidates that explain given shares of the simulation error."""

    def __init__(self, *shares):
        self.candidates, self.by_simulation, self.ignores_simulation = [None] * len(shares), set(), False
        self.simulation_shares = lambda chosen: np.array(shares)
        self.value = lambda chosen: 0.0
        self.p_value = lambda index, scan: 1e-6


def test_a_candidate_of_the_simulation_error_precedes_one_that_explains_hardly_any():
    """Claim: one of 1.6 % of the error gives way to 24 %, not to 10 %, nor to one without gain, nor once it is lost."""
    gains = lambda *values: Scan(np.array(values), np.zeros(len(values)), [], np.zeros(len(values)))
    selector = Simulated(0.016, 0.24, 0.3)
    assert selector.next_candidate([], gains(137.0, 27.0, -1.0)) == 1
    assert selector.by_simulation == {1}
    assert Simulated(0.016, 0.1).next_candidate([], gains(137.0, 27.0)) == 0
    assert Simulated(0.05, 0.24).next_candidate([], gains(137.0, 27.0)) == 0
    selector.ignore_simulation()
    assert selector.next_candidate([], gains(137.0, 27.0, -1.0)) == 0
    assert selector.by_simulation == set()


def test_rivals_of_what_simulation_selected_explain_as_much_of_its_error():
    """Claim: what explains less than half of its share, or leaves more than twice as much, is none of its rivals."""
    selector = Simulated(0.016, 0.24, 0.13, 0.11)
    selector.by_simulation.add(1)
    assert selector.alternatives_to([], 1).tolist() == [False, True, True, False]
    assert selector.alternatives_to([], 0).tolist() == [True] * 4
    selector = Simulated(0.9, 0.7, 0.85)
    selector.by_simulation.add(0)
    assert selector.alternatives_to([], 0).tolist() == [True, False, True]


def test_what_explains_most_of_a_large_simulation_error_is_significant():
    """Claim: of significant candidates the one that explains most, if that is more than half of an error above 2 σ."""
    gains = lambda *values: Scan(np.array(values), np.zeros(len(values)), [], np.zeros(len(values)))

    def most(gram, values, *shares):
        selector = Simulated(*shares)
        selector.evidence = SimpleNamespace(view=SimpleNamespace(disturbance=SimpleNamespace(noise=np.ones(2))))
        selector.simulation = SimpleNamespace(gram=np.array([[gram]]), samples=10)
        selector.scan = lambda chosen: gains(*values)
        share = selector.majority_shares()
        return int(np.argmax(share)) if np.any(share) else None

    assert most(50.0, (137.0, 27.0, -1.0), 0.1, 0.54, 0.9) == 1
    assert most(50.0, (137.0, 27.0, -1.0), 0.1, 0.4, 0.9) is None
    assert most(30.0, (137.0, 27.0, -1.0), 0.1, 0.54, 0.9) is None


@pytest.mark.parametrize(
    ("nonparametric", "chosen", "expected"), [(0.3, [], [1]), (0.8, [], []), (0.8, [1], [1]), (0.95, [1], [])]
)
def test_what_explains_most_gives_way_to_a_nonparametric_force(monkeypatch, nonparametric, chosen, expected):
    """Claim: of 70 % of the error, to one that explains more where it was not selected, else to one much nearer."""
    path = sys.modules["jaxsub.discrepancy.acceptance"]
    monkeypatch.setattr(path, "most_explained", lambda *_: nonparametric)
    selector = Simulated(0.1, 0.7)
    selector.majority_shares, selector.simulation = lambda: np.array([0.0, 0.7]), SimpleNamespace(disturbance=None)
    found = object.__new__(Examination)
    named = SimpleNamespace(named=[SimpleNamespace(number=i) for i in chosen])
    for part, value in {"naming": named, "selector": selector, "view": None}.items():
        object.__setattr__(found, part, value)
    assert proposed_effects(found, Judged("unknown", [], 1e-9, [])) == expected
    assert selector.by_simulation == {*expected}
