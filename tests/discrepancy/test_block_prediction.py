"""Whether blocks of the recordings are predicted better by the others with an effect, by products of columns."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxsub.discrepancy.linearise.products import Products, conditional
from jaxsub.discrepancy.linearise.view import Parts
from jaxsub.likelihood import Disturbance


def gain(columns):
    """By how much an effect raises the log density of four blocks given the others.

    By whitened columns: a residual, a coefficient's and the effect's. Where the effect is left out a disturbance stands
    for it, of a variance that is 1.5 of the noise's.
    """
    bare = Parts(np.stack([w.T @ w for w in np.split(np.column_stack(columns), 4)]), np.zeros(4))
    wide = Parts(bare.products / 1.5, np.full(4, 25.0 * np.log(1.5)))

    def predicted(parts, chosen):
        gram = Products(Disturbance(*jnp.ones((3, 1))), parts.products.sum(axis=0), 0.0, 200, 2).with_priors(chosen)
        count = 2 + len(chosen)
        return float(np.sum(conditional(gram, parts._replace(products=parts.products[:, :count, :count]))))

    return predicted(bare, [0]) - predicted(wide, [])


@pytest.mark.parametrize(("alike", "better"), [(0.0, True), (1.0, False)])
def test_an_effect_of_one_block_alone_need_not_be_predicted_by_the_others(alike, better):
    """Claim: one that is seen in one block alone predicts no worse; one seen in all, of other sizes, does."""
    rng = np.random.default_rng(5)
    shown = rng.standard_normal(200) * np.where(np.repeat(range(4), 50) == 3, 1.0, alike)
    sizes = np.repeat([2.0, -2.0, 2.0, -2.0], 50)
    assert (gain([0.1 * rng.standard_normal(200) + sizes * shown, rng.standard_normal(200), shown]) > 0.0) == better


@pytest.mark.parametrize("seed", range(5))
def test_a_poorly_identified_coefficient_does_not_hide_an_effect(seed):
    """Claim: a coefficient that one block identifies, and the others hardly, allows for its uncertainty there."""
    rng = np.random.default_rng(seed)
    shown, moved = rng.standard_normal(200), rng.standard_normal(200) * np.repeat([0.03, 0.03, 0.03, 1.0], 50)
    assert gain([rng.standard_normal(200) + 0.4 * shown, moved, shown]) > 0.0
