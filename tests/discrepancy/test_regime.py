"""A regime is found where a mismatch has one, at its threshold, and hardly ever where it has none."""

from types import SimpleNamespace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from jaxsub.discrepancy.explain.regime import regime, regime_variables
from jaxsub.discrepancy.explain.show import trades
from jaxsub.estimate import Solution
from jaxsub.vehicle.catalogue import nps_auv_ii

RUNS, SAMPLES, DEAD = 3, 600, 40


def slow(rng, memory=0.97):
    """Runs of a variable that wanders about zero."""
    wander = rng.normal(size=(RUNS, SAMPLES))
    for k in range(1, SAMPLES):
        wander[:, k] += memory * wander[:, k - 1]
    return wander / wander.std()


def drawn(seed):
    """Slow variables, and where the runs have samples: one is shorter than the others."""
    rng = np.random.default_rng(seed)
    variables = {name: slow(rng) for name in "uz"}
    variables |= {f"abs({name})": np.abs(slow(rng)) for name in "rvwpq"}
    live = np.ones((RUNS, SAMPLES), bool)
    live[-1, -DEAD:] = False
    return variables, live


@pytest.mark.parametrize(("name", "above", "threshold"), [("abs(r)", True, 1.2), ("z", False, -0.7)])
def test_the_regime_of_a_mismatch_is_found_at_its_threshold(name, above, threshold):
    """Claim: with one sample in twenty astray, the variable and the side in all of 20 records, the threshold near."""
    found = []
    for seed in range(20):
        variables, live = drawn(seed)
        within = (variables[name] > threshold) == above
        inside = within ^ (np.random.default_rng(seed).random(within.shape) < 0.05)
        found.append(regime(variables, inside, live))
    assert {(one.variable, one.above) for one in found} == {(name, above)}
    assert np.median([one.threshold for one in found]) == pytest.approx(threshold, abs=0.1)
    assert min(one.inside for one in found) > 0.8 and max(one.outside for one in found) < 0.15


def test_intervals_without_a_regime_are_rarely_given_one():
    """Claim: intervals that depend on nothing have one in no more of 60 records than chance allows."""
    said = 0
    for seed in range(60):
        variables, live = drawn(seed)
        said += regime(variables, slow(np.random.default_rng(1000 + seed)) > 0.8, live) is not None
    assert said / 60 < 0.05 + 2.0 * np.sqrt(0.05 * 0.95 / 60)


def test_nothing_everything_and_no_variable_have_no_regime():
    """Claim: where no sample is inside, or all are, or nothing moves, there is none."""
    variables, live = drawn(1)
    nothing = np.zeros((RUNS, SAMPLES), bool)
    assert regime(variables, nothing, live) is None
    assert regime(variables, ~nothing, live) is None
    assert regime({}, variables["u"] > 0.0, live) is None


def test_variables_are_speed_incidence_and_what_moves():
    """Claim: for states of a body they hold speed and incidence by their formulas, sizes where both signs occur."""
    vehicle = nps_auv_ii()
    rng = np.random.default_rng(3)
    states = 0.1 * rng.normal(size=(2, 50, len(vehicle.layout.states)))
    states[..., 0] += 1.8
    states[..., 2] -= 1.5
    signals = jnp.zeros((2, 50, len(vehicle.layout.inputs)))
    found = regime_variables(eqx.filter_jit(lambda at: vehicle.motion(at, signals))(jnp.asarray(states)))
    u, v, w = np.moveaxis(states[..., :3], -1, 0)
    np.testing.assert_allclose(found["speed"], np.sqrt(u**2 + v**2 + w**2))
    np.testing.assert_allclose(found["attack"], np.arctan2(w, u))
    assert found["w"].max() < 0.0
    np.testing.assert_allclose(found["abs(sideslip)"], np.abs(np.arctan2(v, u)))
    np.testing.assert_allclose(found["u"], u)
    assert not any("rudder" in name for name in found)


def test_an_effect_trades_with_what_its_numbers_go_with():
    """Claim: correlations of 0.9 and more with another's numbers are told, the strongest first, its own not."""
    root = np.array([[1.0, 0.0, 0.0, 0.0], [0.99, 0.14, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [-0.93, 0.0, 0.0, 0.37]])
    scale = np.array([1e3, 1e-2, 1.0, 5.0])
    covariance = (root @ root.T) * scale * scale[:, None]
    fit = object.__new__(Solution)
    rows = [SimpleNamespace(name=name) for name in ("drag.C", "drag.D", "Y_r", "Y_v")]
    object.__setattr__(fit, "vehicle", SimpleNamespace(layout=SimpleNamespace(free=rows)))
    object.__setattr__(fit, "covariance", jnp.asarray(covariance))
    assert trades(fit, "drag") == pytest.approx({"Y_v": -0.93 / np.hypot(0.93, 0.37)}, rel=1e-9)
    assert trades(fit, "none") == {}
