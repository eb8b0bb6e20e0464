"""What a free run or a part of the recordings asks for, and what stood in for something else."""

import sys
from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import pytest

from jaxsub.discrepancy.acceptance import Examination, Model, ModelFitter, proposed_effects
from jaxsub.discrepancy.cross_validation import Comparison, Gain
from jaxsub.discrepancy.name import Named
from jaxsub.discrepancy.products import Products, conditional
from jaxsub.discrepancy.selector import Scan, Selector
from jaxsub.discrepancy.structure_search import without_redundant
from jaxsub.discrepancy.verdict import Judged
from jaxsub.discrepancy.view import Parts
from jaxsub.effects.hull_damping import CubicDamping, QuadraticDamping
from jaxsub.likelihood import Disturbance


class Freely(Selector):
    """What `foremost`, `stand_in` and `ruling` ask of a selector: shares of a free run's errors, which are given."""

    def __init__(self, *shares):
        self.candidates, self.freely, self.lost = [None] * len(shares), set(), False
        self.of_free_run = lambda chosen: np.array(shares)
        self.value = lambda chosen: 0.0
        self.p_value = lambda index, scan: 1e-6


def test_what_a_free_run_asks_for_comes_before_what_hardly_shows_in_one():
    """Claim: a leader of 1.6 % of a free run's errors gives way to 24 %, not to 10 %, without gain or once lost."""
    gains = lambda *values: Scan(np.array(values), np.zeros(len(values)), [], np.zeros(len(values)))
    asked = Freely(0.016, 0.24, 0.3)
    assert asked.foremost([], gains(137.0, 27.0, -1.0)) == 1
    assert asked.freely == {1}
    assert Freely(0.016, 0.1).foremost([], gains(137.0, 27.0)) == 0
    assert Freely(0.05, 0.24).foremost([], gains(137.0, 27.0)) == 0
    asked.lose_free_run()
    assert asked.foremost([], gains(137.0, 27.0, -1.0)) == 0
    assert asked.freely == set()


def test_only_what_explains_as_much_of_a_free_run_stands_in_for_what_it_asked_for():
    """Claim: less than half of its share, or more than twice what it leaves, is none of its rivals."""
    asked = Freely(0.016, 0.24, 0.13, 0.11)
    asked.freely.add(1)
    assert asked.stand_in([], 1).tolist() == [False, True, True, False]
    assert asked.stand_in([], 0).tolist() == [True] * 4
    asked = Freely(0.9, 0.7, 0.85)
    asked.freely.add(0)
    assert asked.stand_in([], 0).tolist() == [True, False, True]


@pytest.mark.parametrize(("column", "helps"), [(1.0, True), (0.0, False)])
def test_what_one_part_alone_shows_is_not_refused_by_the_others(column, helps):
    """Claim: an effect seen in one part need not foretell it; one seen in all, of other sizes, must and fails."""
    rng = np.random.default_rng(5)
    shown = rng.standard_normal(200) * np.where(np.repeat(range(4), 50) == 3, 1.0, 1.0 - column)
    sizes = np.repeat([2.0, -2.0, 2.0, -2.0], 50)
    columns = [0.1 * rng.standard_normal(200) + sizes * shown, rng.standard_normal(200), shown]
    assert in_four_parts(columns).predicts([], 0) == helps


@pytest.mark.parametrize("seed", range(5))
def test_what_others_hardly_tell_of_a_coefficient_is_not_held_against_an_effect(seed):
    """Claim: a coefficient that moves in one part, and hardly in the others, does not hide an effect that all show."""
    rng = np.random.default_rng(seed)
    shown, moved = rng.standard_normal(200), rng.standard_normal(200) * np.repeat([0.03, 0.03, 0.03, 1.0], 50)
    assert in_four_parts([rng.standard_normal(200) + 0.4 * shown, moved, shown]).predicts([], 0)


def in_four_parts(columns):
    """A selector of one effect, by whitened columns: a residual, a coefficient's and the effect's.

    Where the effect is left out a disturbance stands for it, of a variance that is 1.5 of the noise's.
    """
    bare = Parts(np.stack([w.T @ w for w in np.split(np.column_stack(columns), 4)]), np.zeros(4))
    wide = Parts(bare.products / 1.5, np.full(4, 25.0 * np.log(1.5)))
    still = Disturbance(*jnp.ones((3, 1)))
    whole = lambda parts: Products(still, parts.products.sum(axis=0), float(parts.log_determinants.sum()), 200, 2)
    at = lambda parts, count: parts._replace(products=parts.products[:, :count, :count])
    asked = object.__new__(Selector)
    asked.owners, asked.freely = [[0]], set()
    asked.evidence = SimpleNamespace(
        best=lambda columns: (0.0, whole(bare if columns else wide)),
        predicted=lambda columns, products: conditional(
            products.with_priors(columns), at(bare if columns else wide, 2 + len(columns))
        ),
    )
    return asked


def test_what_rules_a_free_run_need_not_be_what_was_chosen_sample_by_sample():
    """Claim: of those that the recordings ask for the one that explains most rules, if that is more than half."""
    gains = lambda *values: Scan(np.array(values), np.zeros(len(values)), [], np.zeros(len(values)))

    def ruling(gram, values, *shares):
        asked = Freely(*shares)
        asked.evidence = SimpleNamespace(view=SimpleNamespace(disturbance=SimpleNamespace(noise=np.ones(2))))
        asked.free = SimpleNamespace(gram=np.array([[gram]]), samples=10)
        asked.scan = lambda chosen: gains(*values)
        share = asked.ruling()
        return int(np.argmax(share)) if np.any(share) else None

    assert ruling(50.0, (137.0, 27.0, -1.0), 0.1, 0.54, 0.9) == 1
    assert ruling(50.0, (137.0, 27.0, -1.0), 0.1, 0.4, 0.9) is None
    assert ruling(30.0, (137.0, 27.0, -1.0), 0.1, 0.54, 0.9) is None


@pytest.mark.parametrize("kept", [True, False])
def test_what_stood_in_for_a_later_effect_is_left_out(monkeypatch, kept):
    """Claim: an older effect without which the training runs are predicted as well goes, and its name with it."""
    old, new = CubicDamping("yaw", -0.5), QuadraticDamping("surge", -0.5)
    fit = SimpleNamespace(vehicle=SimpleNamespace(all_effects=(old, new)))
    best, fewer = Model(fit, SimpleNamespace(disturbance=None), None, (old, new)), Model(fit, None, None, (new,))
    fitter, asked = object.__new__(ModelFitter), []
    fitted = lambda base, effects, disturbance: asked.append(effects) or fewer
    object.__setattr__(fitter, "with_effects", fitted)
    path = sys.modules["jaxsub.discrepancy.structure_search"]
    said = Comparison(Gain(1.0, 1.0 - kept, float(kept)), Gain(0.0, 1.0, 1.0), 1.0, True)
    monkeypatch.setattr(path, "compare", lambda before, after: said)
    monkeypatch.setattr(Model, "significant", True)
    judged = Judged("named", [Named(0, old, 1.0, [], []), Named(1, new, 1.0, [], [])], 1e-9, [])
    model, after = without_redundant(fitter, Model(None, None, None, ()), best, judged, [old])
    assert asked == [[new]]
    assert model is (best if kept else fewer)
    assert [one.effect for one in after.named] == ([old, new] if kept else [new])
    assert len(after.notes) == (0 if kept else 1)


@pytest.mark.parametrize(
    ("nameless", "chosen", "expected"), [(0.3, [], [1]), (0.8, [], []), (0.8, [1], [1]), (0.95, [1], [])]
)
def test_what_rules_gives_way_to_a_force_without_a_name(monkeypatch, nameless, chosen, expected):
    """Claim: of 0.7 of a free run, to one that explains any more where it was not chosen, else to one much nearer."""
    path = sys.modules["jaxsub.discrepancy.acceptance"]
    monkeypatch.setattr(path, "most_explained", lambda *_: nameless)
    asked = Freely(0.1, 0.7)
    asked.ruling, asked.free = lambda: np.array([0.0, 0.7]), SimpleNamespace(disturbance=None)
    found = object.__new__(Examination)
    named = SimpleNamespace(named=[SimpleNamespace(number=i) for i in chosen])
    for part, value in {"naming": named, "selector": asked, "view": None}.items():
        object.__setattr__(found, part, value)
    assert proposed_effects(found, Judged("unknown", [], 1e-9, [])) == expected
    assert asked.freely == {*expected}
