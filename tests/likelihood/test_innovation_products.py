"""Products of innovations against dense Gaussian algebra; their derivative against differences and reverse mode."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxsub.likelihood.innovation_products import (
    Derivatives,
    Steps,
    innovation_products,
    passes,
    products_adjoint,
    products_and_begun,
)

R, K, Z, N, C, S, Q = 2, 6, 5, 2, 3, 3, 4


def some_steps(forced: bool, samples: int = K) -> tuple[Steps, jax.Array]:
    """A small system of two runs, changing from sample to sample, and the covariance that it begins with."""
    rng = np.random.default_rng(11)
    draw = lambda *shape: jnp.asarray(rng.normal(size=shape))
    root = draw(Z, Z)
    forcing = draw(R, samples - 1, S, Q) if forced else None
    F, B, output = 0.5 * draw(R, samples, Z, Z), draw(R, samples, Z, N), draw(R, samples, C, S)
    steps = Steps(F, B, output, 1.0 + draw(R, samples, C) ** 2, draw(R, samples, C, Q), forcing)
    return steps, root @ root.T


def weighed(given: tuple[Steps, jax.Array], through) -> jax.Array:
    """A number that depends on both results."""
    gram, spread = through(*given)
    weights = jnp.asarray(np.random.default_rng(12).normal(size=(Q, Q)))
    return jnp.sum(weights * gram) + 1.7 * spread


def plainly(steps: Steps, begin: jax.Array) -> tuple[jax.Array, jax.Array]:
    """The same products from the filter's pass, which JAX differentiates by itself."""
    white, factor = passes(steps, begin, lambda passed: (passed.white, passed.factor))
    return jnp.einsum("rkca,rkcb->ab", white, white), jnp.sum(jnp.log(jnp.diagonal(factor, axis1=-2, axis2=-1)))


def symmetric(M: jax.Array) -> jax.Array:
    return 0.5 * (M + M.T)


def test_products_are_those_of_the_dense_gaussian():
    """Claim: they equal Xᵀ Σ⁻¹ X and half ln|Σ| with the covariance of all samples of each run written out."""
    steps, begin = some_steps(forced=True)
    gram, spread = np.zeros((Q, Q)), 0.0
    for r in range(R):
        F, B, output, noise, shown = (np.asarray(part[r]) for part in steps[:5])
        forcing = np.pad(np.asarray(steps.forcing[r]), ((0, 1), (0, 0), (0, 0)))
        cov, mean = np.zeros((K * C, K * C)), np.zeros((K * C, Q))
        state, states = np.zeros((Z, Q)), [np.asarray(begin)]
        for k in range(K):
            mean[k * C : (k + 1) * C] = output[k] @ state[:S]
            state = F[k] @ state - np.pad(forcing[k], ((0, Z - S), (0, 0)))
            states.append(F[k] @ states[k] @ F[k].T + B[k] @ B[k].T)
        H = np.pad(output, ((0, 0), (0, 0), (0, Z - S)))
        for j in range(K):
            through = states[j]
            for k in range(j, K):
                cov[k * C : (k + 1) * C, j * C : (j + 1) * C] = H[k] @ through @ H[j].T
                cov[j * C : (j + 1) * C, k * C : (k + 1) * C] = (H[k] @ through @ H[j].T).T
                through = F[k] @ through
        cov += np.diag(noise.ravel())
        left = shown.reshape(K * C, Q) - mean
        gram += left.T @ np.linalg.solve(cov, left)
        spread += 0.5 * np.linalg.slogdet(cov)[1]
    found = innovation_products(steps, begin)
    np.testing.assert_allclose(found[0], gram, rtol=1e-10)
    assert float(found[1]) == pytest.approx(spread, rel=1e-12)


def by_adjoint(steps: Steps, begin: jax.Array) -> Derivatives:
    """The derivatives of `weighed` by the adjoint."""
    weights = jnp.asarray(np.random.default_rng(12).normal(size=(Q, Q)))
    _, begun = products_and_begun(steps, begin)
    return products_adjoint(steps, begun, weights, jnp.asarray(1.7))


@pytest.mark.parametrize("samples", [K, 150])
@pytest.mark.parametrize("forced", [True, False])
def test_the_adjoint_is_reverse_differentiation(forced, samples):
    """Claim: the derivatives by dynamics, noise, start and residual are JAX's, in one piece of a run or in more."""
    given = some_steps(forced, samples)
    steps, begin = jax.grad(weighed)(given, plainly)
    theirs = steps.F, steps.B, steps.noise, symmetric(begin), steps.shown[..., 0]
    for ours, own in zip(by_adjoint(*given), theirs, strict=True):
        np.testing.assert_allclose(ours, own, rtol=1e-9, atol=1e-11)


def test_the_adjoint_agrees_with_differences():
    """Claim: along random directions of dynamics, noise, start and residual it is the central difference."""
    steps, begin = some_steps(forced=True)
    slopes = by_adjoint(steps, begin)
    rng = np.random.default_rng(13)
    for _ in range(3):
        way = Derivatives(*(jnp.asarray(rng.normal(size=slope.shape)) for slope in slopes))
        way = way._replace(begin=symmetric(way.begin))

        def moved(h, way=way):
            shown = steps.shown.at[..., 0].add(h * way.residual)
            parts = {name: getattr(steps, name) + h * getattr(way, name) for name in ("F", "B", "noise")}
            return weighed((steps._replace(shown=shown, **parts), begin + h * way.begin), innovation_products)

        difference = (moved(1e-6) - moved(-1e-6)) / 2e-6
        slope = sum(jnp.sum(a * b) for a, b in zip(slopes, way, strict=True))
        assert float(slope) == pytest.approx(float(difference), rel=1e-6)


def test_memory_of_the_adjoint_is_that_of_the_steps():
    """Claim: from 256 to 1024 samples its memory, results apart, grows by less than what it was given."""

    def memory(samples: int) -> tuple[int, int]:
        given = some_steps(False, samples)
        compiled = jax.jit(by_adjoint).lower(*given).compile()
        used = compiled.memory_analysis()
        assert used is not None
        return used.temp_size_in_bytes, sum(leaf.nbytes for leaf in jax.tree.leaves(given))

    (few, given), (many, more) = memory(256), memory(1024)
    assert many - few < more - given
