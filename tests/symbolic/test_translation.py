"""A function on JAX arrays and its CasADi counterpart agree wherever they are asked, and so do its derivatives."""

import casadi
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jaxsub.errors import InputError
from jaxsub.symbolic import casadi_function

A = jnp.asarray(np.random.default_rng(5).normal(size=(4, 4)))
POSITIVE = A @ A.T + 4.0 * jnp.eye(4)
PAIRS = jnp.asarray([[2, 0], [1, 3]])


def _powers(x):
    return jax.lax.while_loop(lambda c: c[0] < 4, lambda c: (c[0] + 1, c[1] * x), (0, x))[1]


def _carried(x):
    return jax.lax.scan(lambda c, row: (0.5 * c + row, c * row), x, jnp.outer(x, x), reverse=True)


FUNCTIONS = {
    "arithmetic": lambda x: (x**3 - 2.0 * x) / (1.0 + x**2) + jnp.exp(-(x**2)) * jnp.abs(x) + x**-2,
    "circular": lambda x: jnp.sin(x) * jnp.arctan2(x, 2.0) + jnp.tanh(x) + jnp.arcsin(x / 9.0) - jnp.cosh(x / 3.0),
    "roots": lambda x: jnp.sqrt(1.0 + x**2) + jnp.log1p(x**2) + jnp.cbrt(2.0 + x**2) * jax.lax.rsqrt(1.0 + x**2),
    "limits": lambda x: jnp.clip(x, -0.5, 0.7) + jnp.maximum(x, x[0]) - jnp.minimum(x[::-1], 0.1) + jnp.sign(x),
    "steps": lambda x: jnp.floor(x) + jnp.ceil(2.0 * x) + jnp.round(3.0 * x) + jnp.fmod(x, 0.3) + x.astype(int),
    "choice": lambda x: jnp.where((x > 0.1) & ~(x > 0.9) | (x < -1.0), jnp.log(jnp.abs(x)), x**2),
    "sides that are not finite": lambda x: jnp.where(jnp.isfinite(x / 0.0), 1.0 / (x - x), x),
    "which": lambda x: jnp.argmax(x) + 10.0 * jnp.argmin(x**2) + jnp.sum(x) + jnp.prod(x) + jnp.max(x) - jnp.min(x),
    "sums so far": lambda x: jnp.cumsum(x) * jnp.cumprod(x) + jax.lax.cummax(x) - jax.lax.cummin(x, reverse=True),
    "truths": lambda x: jnp.where(jnp.any(x > 1.0) ^ jnp.all(x < 1.5), x, -x),
    "matrices": lambda x: A @ x + jnp.outer(x, x) @ x + jnp.einsum("ij,jk,k->i", A, A, x),
    "moves": lambda x: jnp.concatenate([x[::-1], jnp.pad(jnp.roll(x, 1), (1, 2)), x[PAIRS].ravel()]),
    "stacked": lambda x: jnp.stack([x, 2.0 * x]).T.reshape(-1)[1:7:2],
    "put": lambda x: jnp.zeros(6).at[jnp.asarray([4, 1, 0, 5])].set(x).at[jnp.asarray([1, 1])].add(x[:2]),
    "places told later": lambda x: x[jnp.argmax(x)] + A[jnp.argmin(x)] + jnp.roll(A, 1, 0)[:, jnp.argmax(x)],
    "a window told later": lambda x: jax.lax.dynamic_slice(
        jax.lax.dynamic_update_slice(jnp.arange(9.0), x[:2], (jnp.argmax(x),)), (jnp.argmin(x) + 4,), (3,)
    ),
    "branches": lambda x: jax.lax.switch(jnp.argmax(x), [lambda v: v, lambda v: 2.0 * v, jnp.sin, jnp.cos], x),
    "a known branch": lambda x: jax.lax.cond(A[0, 0] > 5.0, jnp.sin, jnp.cos, x),
    "loops": _carried,
    "a barrier": lambda x: sum(jax.lax.optimization_barrier((jnp.sin(x), jnp.cos(x)))),
    "a known number of turns": _powers,
    "cholesky": lambda x: jnp.linalg.cholesky(POSITIVE + jnp.outer(x, x))[jnp.tril_indices(4)],
    "triangles": lambda x: jax.scipy.linalg.solve_triangular(jnp.tril(A) + 3.0 * jnp.eye(4), x, lower=True, trans=1),
    "systems": lambda x: jnp.linalg.solve(POSITIVE + jnp.diag(x**2), x) + jnp.linalg.inv(POSITIVE) @ x,
    "derivatives": lambda x: jax.jacfwd(lambda v: jnp.sin(v) * jnp.sum(v**2))(x) @ jax.grad(lambda v: jnp.sum(v**4))(x),
}  # fmt: skip
X = [
    np.array([0.3, -1.2, 0.9, 2.1]),
    np.array([-0.4, 0.05, 1.7, -2.3]),
    np.array([1.4, 1.2, -0.8, 0.6]),
]


@pytest.mark.parametrize("name", FUNCTIONS)
def test_values_agree(name):
    """With JAX's own, compiled, to rounding."""
    call = FUNCTIONS[name]
    function = casadi_function(call, jnp.zeros(4))
    for x in X:
        expected = jax.tree.leaves(jax.jit(call)(jnp.asarray(x)))
        found = function.call([casadi.DM(x)])
        for own, theirs in zip(expected, found, strict=True):
            flat = np.asarray(theirs) if own.ndim == 2 else np.asarray(theirs).reshape(own.shape)
            np.testing.assert_allclose(flat, own, rtol=1e-12, atol=1e-12)


SMOOTH = (
    "arithmetic",
    "circular",
    "roots",
    "matrices",
    "loops",
    "cholesky",
    "systems",
    "branches",
    "places told later",
)


@pytest.mark.parametrize("name", SMOOTH)
def test_derivatives_agree(name):
    """CasADi's of the translation with JAX's of the function."""
    flat = lambda x: jnp.concatenate([jnp.ravel(leaf) for leaf in jax.tree.leaves(FUNCTIONS[name](x))])
    function = casadi_function(flat, jnp.zeros(4))
    x = casadi.SX.sym("x", 4)
    jacobian = casadi.Function("jacobian", [x], [casadi.jacobian(function(x), x)])
    for at in X:
        expected = jax.jacfwd(flat)(jnp.asarray(at))
        np.testing.assert_allclose(np.asarray(jacobian(at)), expected, rtol=1e-10, atol=1e-10)


@settings(max_examples=30, deadline=None)
@given(
    shape=st.lists(st.integers(1, 3), min_size=1, max_size=4),
    seed=st.integers(0, 2**31),
    data=st.data(),
)
def test_products_over_any_axes_agree(shape, seed, data):
    """`dot_general` with any batch and any contraction against NumPy's einsum by letters."""
    rng = np.random.default_rng(seed)
    letters = "abcdefgh"
    first = letters[: len(shape)]
    size = dict(zip(first, shape, strict=True))
    second = data.draw(st.permutations(first)).copy()
    second = "".join(second[: data.draw(st.integers(1, len(shape)))]) + "z"
    size["z"] = 2
    kept = "".join(sorted(c for c in {*first, *second} if data.draw(st.booleans())))
    a, b = rng.normal(size=shape), rng.normal(size=[size[c] for c in second])
    formula = f"{first},{second}->{kept}"
    function = casadi_function(lambda x: jnp.einsum(formula, x.reshape(shape), b), jnp.zeros(a.size))
    expected = np.einsum(formula, a, b)
    found = np.asarray(function(a.ravel()))
    np.testing.assert_allclose(found if expected.ndim == 2 else found.reshape(expected.shape), expected, atol=1e-12)


def test_what_is_known_leaves_no_trace():
    """A matrix that no argument enters is inverted while the function is made."""
    bare = casadi_function(lambda x: np.linalg.inv(np.asarray(POSITIVE)) @ x, jnp.zeros(4))
    folded = casadi_function(lambda x: jnp.linalg.inv(POSITIVE) @ x, jnp.zeros(4))
    # equal but for the last bit of numbers that are then shared or not
    assert folded.n_instructions() < 1.2 * bare.n_instructions()


def test_arguments_and_results_are_named_and_shaped():
    """Trees in, trees out: a name for each leaf, matrices as matrices."""
    call = lambda state, u: {"sum": state["A"] @ u, "turned": state["A"].T}
    like = ({"A": jnp.zeros((2, 3))}, jnp.zeros(3))
    function = casadi_function(call, *like, name="f", arguments=("A", "u"), results=("sum", "turned"))
    B, u = np.arange(6.0).reshape(2, 3), np.array([1.0, -1.0, 2.0])
    found = function(A=B, u=u)
    np.testing.assert_array_equal(np.asarray(found["sum"]).ravel(), B @ u)
    np.testing.assert_array_equal(np.asarray(found["turned"]), B.T)


UNSUPPORTED = {
    "while": lambda x: jax.lax.while_loop(lambda c: c[0] < x[0], lambda c: c + 1.0, x),
    "sort": jnp.sort,
    "qr": lambda x: jnp.linalg.qr(jnp.diag(x), mode="r"),
    "erf_inv": jax.scipy.special.erfinv,
}


@pytest.mark.parametrize("name", UNSUPPORTED)
def test_what_has_no_counterpart_is_said_by_name(name):
    with pytest.raises(InputError, match=name if name != "qr" else "geqrf|qr"):
        casadi_function(UNSUPPORTED[name], jnp.ones(4))
