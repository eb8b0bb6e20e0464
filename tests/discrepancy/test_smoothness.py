"""A smooth function's evidence is the Gaussian integral it claims to be, rare by chance, and sees many periods."""

import jax.numpy as jnp
import numpy as np
from scipy import special, stats

from jaxsub.discrepancy.linearise.products import Products
from jaxsub.discrepancy.propose.smoothness import FINE, coarse, smoothest
from jaxsub.effects import KNOTS, Motion, SmoothForce
from jaxsub.likelihood import Disturbance

SAMPLES, KNOWN = 600, 3


def hat_matrix(x, knots):
    return np.maximum(0.0, 1.0 - np.abs(x[:, None] * (knots - 1) - np.arange(knots)))


def told(residual, seed=0, known=lambda x, rng: rng.normal(size=len(x))):
    """Products of a residual, two free parameters, one `known`, and a variable's hats, which are of unit length."""
    rng = np.random.default_rng(seed)
    x = 0.5 + 0.5 * np.sin(np.cumsum(rng.normal(size=SAMPLES)) / 9.0)
    hats = hat_matrix(x, FINE)
    length = np.maximum(np.linalg.norm(hats, axis=0), 1e-9)
    W = np.column_stack([residual(x, rng), rng.normal(size=SAMPLES), known(x, rng), hats / length])
    gram = W.T @ W
    gram[range(1, KNOWN), range(1, KNOWN)] += 0.2
    return W, length, Products(Disturbance(*jnp.ones((3, 1))), gram, 0.0, SAMPLES, KNOWN)


def test_evidence_is_the_integral_over_functions():
    """Claim: the gain is the difference of two dense Gaussian log densities, with the function's covariance in one."""
    W, length, products = told(lambda x, rng: rng.normal(size=len(x)) + np.sin(9.0 * x))
    found = smoothest(products, [], range(FINE), length)
    columns = W[:, KNOWN:] @ found.weights
    J = W[:, 1:KNOWN]
    plain = np.eye(SAMPLES) + J @ J.T / 0.2
    # columns of the prior are worth one sample: amplitudes of variance N
    density = lambda covariance: stats.multivariate_normal(np.zeros(SAMPLES), covariance).logpdf(W[:, 0])
    oracle = density(plain + SAMPLES * columns @ columns.T) - density(plain)
    np.testing.assert_allclose(found.gain, oracle, rtol=1e-6)
    mixed = products.mixed(products.sums([], range(FINE), found.weights), KNOWN)
    np.testing.assert_allclose(mixed.log_evidence(range(FINE)) - products.log_evidence([]), oracle, rtol=1e-6)


def test_it_is_rare_by_chance():
    """Claim: of 200 records without a function no more than 5 % and chance have p below 0.05, three scales counted."""
    noise = lambda x, rng: rng.normal(size=len(x))
    draws = [told(noise, seed) for seed in range(200)]
    gains = np.array([smoothest(products, [], range(FINE), length).gain for _, length, products in draws])
    p_values = np.minimum(1.0, 1.5 * special.chdtrc(1, 2.0 * gains))
    assert np.mean(p_values < 0.05) < 0.05 + 2.0 * np.sqrt(0.05 * 0.95 / 200)


def test_a_function_of_many_periods_is_seen_and_drawn():
    """Claim: nine periods at a signal-to-noise ratio of 0.7 have p below 1e-20, and heights within half of them."""
    wave = lambda x: np.sin(2.0 * np.pi * 9.0 * x)
    _, length, products = told(lambda x, rng: rng.normal(size=len(x)) + wave(x))
    found = smoothest(products, [], range(FINE), length)
    assert 1.5 * special.chdtrc(1, 2.0 * found.gain) < 1e-20
    mixed = products.mixed(products.sums([], range(FINE), found.weights), KNOWN)
    (amplitudes,) = mixed.gains([], [range(FINE)]).amplitudes
    heights = found.weights @ amplitudes / length
    truth = wave(np.linspace(0.0, 1.0, FINE))
    assert np.linalg.norm(heights - truth) < np.linalg.norm(truth) / 2.0


def test_what_parameters_explain_is_no_function():
    """Claim: a function that a free parameter follows gains nothing, and gains much where none does."""
    wave = lambda x, rng: np.sin(9.0 * x)
    residual = lambda x, rng: rng.normal(size=len(x)) + 3.0 * wave(x, rng)
    _, length, products = told(residual)
    assert smoothest(products, [], range(FINE), length).gain > 100.0
    _, length, products = told(residual, known=wave)
    assert smoothest(products, [], range(FINE), length).gain < 3.0


def test_knots_of_a_smooth_force_are_among_the_fine_ones():
    """Claim: a `SmoothForce` is the fine knots' interpolation of its own heights."""
    rng = np.random.default_rng(1)
    heights = rng.normal(size=KNOTS)
    force = SmoothForce("heave", "z", -1.0, 4.0, **{f"a_{j}": jnp.asarray(a) for j, a in enumerate(heights)})
    z = rng.uniform(-1.0, 4.0, 50)
    still = {name: jnp.zeros(50) for name in ("surge", "sway", "heave", "roll", "pitch", "yaw")}
    motion = Motion(still, {"z": jnp.asarray(z)}, {}, {}, np.eye(6), 0.0, 1.0)
    expected = hat_matrix((z + 1.0) / 5.0, FINE) @ coarse() @ heights
    np.testing.assert_allclose(force.force(motion)["heave"], expected, atol=1e-6)
