"""Fuzzy regression is Tanaka's linear program solved exactly: HiGHS agrees, and the band holds every sample."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from jax.test_util import check_grads
from scipy.optimize import linprog

from jaxsub.errors import InputError
from jaxsub.filter.regression import FuzzyLine, fuzzy_line

M = 9
EVERY = np.ones(M, bool)
UNIFORM = 0.1 * np.arange(M)
TIGHT = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}
fit = jax.jit(fuzzy_line)


def solved(times, values, mask=EVERY, level=0.0) -> FuzzyLine:
    given = (np.asarray(times, float), np.asarray(values, float), np.asarray(mask, bool))
    return fit(*map(jnp.asarray, given), jnp.asarray(level, float))


def columns(fine):
    """Nine numbers: of few values, so that they tie, or of many."""
    few, many = st.integers(-3, 3).map(float), st.integers(-10_000, 10_000).map(lambda number: number / 1000.0)
    of = st.sampled_from([few, many] if fine else [few]).flatmap(lambda kind: st.lists(kind, min_size=M, max_size=M))
    return of.map(np.array)


some_times = columns(fine=True)
some_values = st.one_of(
    columns(fine=True),
    st.integers(-5000, 5000).map(lambda number: np.full(M, number / 1000.0)),
)
slopes = st.integers(-3000, 3000).map(lambda number: number / 1000.0)
masks = st.one_of(st.just(EVERY), st.lists(st.booleans(), min_size=M, max_size=M).filter(any).map(np.array))
levels = st.integers(0, 95).map(lambda percent: percent / 100.0)


def highs(t, x, level) -> float:
    """The least total spread, from equations 20 to 22 as printed."""
    ones = np.ones_like(t)
    inside = (1.0 - level) * np.stack([ones, t], axis=1)
    line = np.stack([ones, t], axis=1)
    A = np.block([[line, -inside], [-line, -inside]])
    bounds = [(None, None), (None, None), (0.0, None), (0.0, None)]
    cost = [0.0, 0.0, len(t), t.sum()]
    found = linprog(cost, A, np.concatenate([x, -x]), bounds=bounds, method="highs", options=TIGHT)
    assert found.status == 0
    return found.fun


def compare(times, values, mask, level):
    line = solved(times, values, mask, level)
    t, x = (times - times[mask].min())[mask], values[mask]
    (p0, p1), (c0, c1) = np.asarray(line.centre), np.asarray(line.spread)
    size = 1.0 + np.abs(x).max() + np.abs(p1) * np.abs(times).max()
    assert c0 >= 0.0 and c1 >= 0.0
    assert line.origin == times[mask].min()
    assert np.all(np.abs(x - p0 - p1 * t) <= (1.0 - level) * (c0 + c1 * t) + 1e-14 * size)
    least = highs(t, x, level)
    assert abs(np.sum(c0 + c1 * t) - least) <= 1e-9 * max(least, 1e-4 * size * len(t) / (1.0 - level))


@given(some_times, some_values, masks, levels)
@settings(max_examples=150, deadline=None, derandomize=True)
def test_total_spread_is_the_least_and_the_band_holds_every_sample(times, values, mask, level):
    compare(times, values, mask, level)


@given(some_times, columns(fine=False), slopes, levels)
@settings(max_examples=60, deadline=None, derandomize=True)
def test_it_is_the_least_around_a_trend_and_on_a_line(times, values, slope, level):
    compare(times, values + slope * times, EVERY, level)
    compare(times, slope * times - 1.0, EVERY, level)


@pytest.mark.parametrize("level", [0.0, 0.5])
def test_windows_worked_out_by_hand(level):
    mask = np.arange(M) < 3
    opening = solved([0.0, 1.0, 1.0, *[5.0] * 6], [0.0, 1.0, -1.0, *[9.0] * 6], mask, level)
    np.testing.assert_allclose(opening.centre, 0.0, atol=1e-15)
    np.testing.assert_allclose(opening.spread, [0.0, 1.0 / (1.0 - level)], atol=1e-15)
    # closing would need a negative c₁: the narrowest strip, along an edge of the triangle
    closing = solved([0.0, 0.0, 1.0, *[5.0] * 6], [1.0, -1.0, 0.0, *[9.0] * 6], mask, level)
    np.testing.assert_allclose(closing.centre, 0.0, atol=1e-15)
    np.testing.assert_allclose(closing.spread, [1.0 / (1.0 - level), 0.0], atol=1e-15)
    # the middle sample is a corner at the mean time: any slope from -1 to 1 is as good for the upper edge
    peak = solved([0.0, 1.0, 2.0, *[5.0] * 6], [0.0, 1.0, 0.0, *[9.0] * 6], mask, level)
    np.testing.assert_allclose(peak.centre, [0.5, 0.0], atol=1e-15)
    np.testing.assert_allclose(peak.spread, [0.5 / (1.0 - level), 0.0], atol=1e-15)


@given(some_values, slopes, st.integers(0, 10**6))
@settings(max_examples=60, deadline=None, derandomize=True)
def test_mirror_scale_line_order_and_clock(values, slope, seed):
    line = solved(UNIFORM, values)
    mirrored = solved(UNIFORM, -values)
    np.testing.assert_array_equal(mirrored.centre, -line.centre)
    np.testing.assert_array_equal(mirrored.spread, line.spread)
    # a power of two has no rounding of its own
    scaled = solved(UNIFORM, 0.25 * values)
    np.testing.assert_array_equal(scaled.centre, 0.25 * line.centre)
    np.testing.assert_array_equal(scaled.spread, 0.25 * line.spread)
    order = np.random.default_rng(seed).permutation(M)
    for other, added in (
        (solved(UNIFORM, values + 0.7 + slope * UNIFORM), np.array([0.7, slope])),
        (solved(UNIFORM[order], values[order]), np.zeros(2)),
        (solved(UNIFORM + 50.0, values), np.zeros(2)),
    ):
        np.testing.assert_allclose(other.centre, line.centre + added, atol=1e-10, rtol=1e-10)
        np.testing.assert_allclose(other.spread, line.spread, atol=1e-10, rtol=1e-10)


@given(some_times, some_values, masks, st.sampled_from([np.nan, np.inf, -1e9, 0.0]))
@settings(max_examples=60, deadline=None, derandomize=True)
def test_missing_samples_do_not_matter(times, values, mask, rubbish):
    line = solved(times, values, mask)
    hidden = solved(np.where(mask, times, rubbish), np.where(mask, values, rubbish), mask)
    jax.tree.map(np.testing.assert_array_equal, line, hidden)


def test_value_at_a_time_is_on_the_clock_of_the_samples():
    line = solved(UNIFORM + 7.0, np.where(np.arange(M) == 4, 1.0, 0.0), EVERY, 0.5)
    for time in (7.3, 6.8):
        centre, spread = line.at(time)
        np.testing.assert_allclose(centre, line.centre[0] + line.centre[1] * (time - 7.0), rtol=1e-14)
        np.testing.assert_allclose(spread, line.spread[0] + line.spread[1] * abs(time - 7.0), rtol=1e-14)


ONE_MISSING = np.arange(M) != 3


@jax.jit
def numbers(times, values, level):
    line = fuzzy_line(times, values, jnp.asarray(ONE_MISSING), level)
    return jnp.concatenate([line.centre, line.spread])


@pytest.mark.parametrize("growing", [True, False])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_derivatives_are_those_of_differences(seed, growing):
    rng = np.random.default_rng(seed)
    times = np.cumsum(rng.uniform(0.1, 1.0, M))
    width = (1.0 + times) if growing else 1.0 / (1.0 + times)
    values = 0.4 * times + width * rng.uniform(0.7, 1.0, M) * (-1.0) ** np.arange(M)
    assert (solved(times, values, ONE_MISSING).spread[1] > 0.0) == growing
    check_grads(numbers, tuple(map(jnp.asarray, (times, values, 0.3))), order=1, eps=1e-6, atol=1e-6, rtol=1e-6)


def test_derivatives_by_the_values_where_the_best_slope_is_a_range():
    rng = np.random.default_rng(5)
    # without the fourth sample, the mean time is that of the fifth, which stands out
    times = np.array([-5.0, -3.0, -2.0, 9.0, 0.0, 1.0, 2.0, 3.0, 4.0])
    values = np.array([4.0, 4.5, 4.8, 9.0, 6.0, -3.0, -3.0, -3.0, -3.0]) + 0.05 * rng.normal(size=M)
    steepest = (values[5:] - values[4]) / times[5:], (values[4] - values[:3]) / -times[:3]
    line = solved(times, values, ONE_MISSING)
    assert line.spread[1] > 0.0
    np.testing.assert_allclose(line.centre[1] + line.spread[1], 0.5 * (steepest[0].max() + steepest[1].min()))
    check_grads(
        lambda values: numbers(jnp.asarray(times), values, jnp.asarray(0.3)),
        (jnp.asarray(values),),
        order=1,
        eps=1e-6,
        atol=1e-6,
        rtol=1e-6,
    )


@pytest.mark.parametrize("precision", [jnp.float32, jnp.float64])
def test_degenerate_windows_have_finite_answers_and_derivatives(precision):
    # constant, on a line, one time, tied in pairs, a single sample, none
    lines = [
        (UNIFORM, np.full(M, 3.0), EVERY),
        (UNIFORM, 2.0 * UNIFORM, EVERY),
        (np.full(M, 5.0), np.arange(M), EVERY),
        (np.arange(M) // 2, np.arange(M) % 3, EVERY),
        (UNIFORM, UNIFORM, np.arange(M) == 4),
        (np.full(M, np.nan), np.full(M, np.nan), ~EVERY),
        (np.where(np.arange(M) == 1, 1e-300, UNIFORM), np.arange(M) % 2, EVERY),
    ]
    times, values, mask = (jnp.asarray(np.stack(column)) for column in zip(*lines, strict=True))
    given = (times.astype(precision), values.astype(precision), mask)

    def total(times, values, mask):
        line = fuzzy_line(times, values, mask, 0.5)
        return jnp.sum(line.centre) + jnp.sum(line.spread), line

    (_, line), derivatives = jax.jit(jax.vmap(jax.value_and_grad(total, argnums=(0, 1), has_aux=True)))(*given)
    for leaf in jax.tree.leaves((line, derivatives)):
        assert leaf.dtype == precision
        assert np.isfinite(leaf).all()
    tolerance = 10.0 * float(jnp.finfo(precision).eps)
    np.testing.assert_allclose(line.spread[0], 0.0, atol=tolerance)
    np.testing.assert_allclose(line.centre[1], [0.0, 2.0], atol=4.0 * tolerance)
    np.testing.assert_allclose(line.centre[2], [4.0, 0.0], atol=tolerance)
    np.testing.assert_allclose(line.spread[2], [8.0, 0.0], atol=tolerance)
    np.testing.assert_allclose(line.centre[4], [0.4, 0.0], atol=tolerance)
    np.testing.assert_array_equal(np.stack([line.centre[5], line.spread[5]]), 0.0)


def test_a_window_of_one_sample():
    line = fuzzy_line(jnp.asarray([4.0]), jnp.asarray([2.0]), jnp.asarray([True]))
    np.testing.assert_array_equal(np.concatenate([[line.origin], line.centre, line.spread]), [4.0, 2.0, 0.0, 0.0, 0.0])


def test_single_precision_is_that_of_its_data():
    rng = np.random.default_rng(8)
    times, values = np.sort(rng.uniform(size=(50, M))).astype("float32"), rng.normal(size=(50, M)).astype("float32")
    batch = jax.jit(jax.vmap(lambda times, values: fuzzy_line(times, values, jnp.asarray(EVERY))))
    single = batch(jnp.asarray(times), jnp.asarray(values))
    double = batch(jnp.asarray(times, float), jnp.asarray(values, float))
    assert single.centre.dtype == jnp.float32
    since = np.mean(times - times.min(axis=1, keepdims=True), axis=1)
    one, other = (line.spread[:, 0] + line.spread[:, 1] * since for line in (single, double))
    np.testing.assert_allclose(one, other, rtol=2e-6)


def test_states_filters_and_windows_are_mapped_alike_by_one_program():
    rng = np.random.default_rng(9)
    shape = (2, 3, 4, M)
    times, values, mask = rng.uniform(size=(4, M)), rng.normal(size=shape), rng.uniform(size=shape) < 0.8
    traced = []

    def line(times, values, mask, level):
        traced.append(level)
        return fuzzy_line(times, values, mask, level)

    windows = jax.vmap(line, (0, 0, 0, None))
    mapped = jax.jit(jax.vmap(jax.vmap(windows, (None, 0, 0, None)), (None, 0, 0, None)))
    for level in (0.2, 0.6):
        found = mapped(*map(jnp.asarray, (times, values, mask, level)))
        for i in np.ndindex(shape[:-1]):
            alone = solved(times[i[-1]], values[i], mask[i], level)
            jax.tree.map(lambda a, b, i=i: np.testing.assert_allclose(a[i], b, rtol=1e-12, atol=1e-13), found, alone)
    assert len(traced) == 1


@pytest.mark.parametrize("level", [-0.1, 1.0, float("nan")])
def test_level_outside_its_range_is_an_input_error(level):
    with pytest.raises(InputError, match="membership level"):
        fuzzy_line(jnp.asarray(UNIFORM), jnp.asarray(UNIFORM), jnp.asarray(EVERY), level)
