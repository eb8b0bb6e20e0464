"""A filter told late says what one says that was told in time, as far back as it remembers."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from filter_cases import Spring

from jaxsub.filter import AbstractGate, ConstantNoise, ExtendedKalmanFilter, FuzzyNoise, Open, Sample, SquareRoot
from jaxsub.filter.late import DelayedFilter, Late

DEPTH, COUNT = 6, 30
R_ROOT = jnp.asarray(np.linalg.cholesky([[4e-4, 1e-4], [1e-4, 9e-4]]))


def spring_filter(gate: AbstractGate = Open(), noise=None):
    noise = noise or FuzzyNoise(jnp.full(2, 1e-3), jnp.full(2, 0.1), width=4)
    return ExtendedKalmanFilter(Spring(), noise, R_ROOT, 0.05 * jnp.eye(2), SquareRoot(), gate)


def record(seed=0):
    """Unevenly spaced samples, a third of the channels measured."""
    rng = np.random.default_rng(seed)
    elapsed = rng.uniform(0.5, 1.5, COUNT)
    mask, scale = rng.random((COUNT, 2)) < 0.3, rng.uniform(0.5, 2.0, (COUNT, 2))
    arrays = rng.normal(size=(COUNT, 1)), elapsed, 0.1 * rng.normal(size=(COUNT, 2))
    inputs, elapsed, outputs = map(jnp.asarray, arrays)
    return Sample(inputs, elapsed, outputs, jnp.asarray(mask), jnp.asarray(scale))


def nothing_late():
    return Late(
        jnp.full((COUNT, 2), np.array(np.nan)), jnp.zeros((COUNT, 2), bool), jnp.ones((COUNT, 2)), jnp.zeros(COUNT)
    )


def held_back(samples, arrivals):
    """The samples without the measurements of `arrivals`, {arrival: (measured, channels)}, and those as late ones."""
    late, mask = nothing_late(), samples.mask
    times = jnp.cumsum(samples.elapsed)
    full = mask
    for arrival, (measured, channels) in arrivals.items():
        channels = jnp.asarray(channels)
        full = full.at[measured].set(full[measured] | channels)
        mask = mask.at[measured].set(mask[measured] & ~channels)
        new = Late(samples.outputs[measured], channels, samples.scale[measured], times[arrival] - times[measured])
        late = jax.tree.map(lambda old, value, arrival=arrival: old.at[arrival].set(value), late, new)
    return dataclasses.replace(samples, mask=full), dataclasses.replace(samples, mask=mask), late


@jax.jit
def in_time(filter, samples):
    state = filter.start(jnp.zeros(2), jnp.array([2.0, 0.4]), 0.3 * jnp.eye(2))
    return jax.lax.scan(lambda state, sample: filter.step(state, sample), state, samples)


@jax.jit
def delayed(filter, samples, late):
    first = jax.tree.map(lambda leaf: leaf[0], samples)
    past = filter.start(filter.filter.start(jnp.zeros(2), jnp.array([2.0, 0.4]), 0.3 * jnp.eye(2)), first)
    return jax.lax.scan(lambda past, both: filter.step(past, *both), past, (samples, late))


def same(found, expected, tolerance=1e-12):
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=tolerance, atol=tolerance), found, expected)


BOTH = [True, True]
CASES = {f"{delay} samples late": {15: (15 - delay, BOTH)} for delay in range(DEPTH)}
CASES["one after another"] = {10: (7, BOTH), 11: (8, BOTH), 12: (9, BOTH)}
CASES["in another order"] = {10: (9, BOTH), 12: (8, BOTH), 13: (11, BOTH), 14: (10, BOTH)}
CASES["the channels apart"] = {12: (9, [False, True]), 13: (9, [True, False])}
CASES["at the first sample"] = {4: (0, BOTH), 5: (2, [True, False])}
CASES["while the memory fills"] = {1: (0, BOTH), 2: (1, BOTH)}


@pytest.mark.parametrize("case", CASES)
def test_what_is_late_counts_as_if_in_time(case):
    filter = spring_filter()
    full, lacking, late = held_back(record(), CASES[case])
    state, expected = in_time(filter, full)
    past, found = delayed(DelayedFilter(filter, DEPTH), lacking, late)
    last = max(CASES[case])
    same(jax.tree.map(lambda leaf: leaf[last:], found), jax.tree.map(lambda leaf: leaf[last:], expected))
    same(past.now, state)
    # and until it comes, it is not there
    _, without = in_time(filter, lacking)
    first = min(CASES[case])
    same(jax.tree.map(lambda leaf: leaf[:first], found), jax.tree.map(lambda leaf: leaf[:first], without))
    if first > CASES[case][first][0]:
        assert np.abs(without.x - expected.x).max() > 1e-4


TOO_OLD = {"beyond the memory": 9.0, "in the future": -2.0, "no number": jnp.nan, "infinite": jnp.inf}


@pytest.mark.parametrize("why", TOO_OLD)
@pytest.mark.parametrize("arrival", [1, 20])
def test_what_is_out_of_reach_changes_nothing(why, arrival):
    filter, samples = spring_filter(), record()
    late = nothing_late()
    far = Late(jnp.ones(2), jnp.ones(2, bool), jnp.ones(2), jnp.asarray(TOO_OLD[why]))
    late = jax.tree.map(lambda old, value: old.at[arrival].set(value), late, far)
    past, found = delayed(DelayedFilter(filter, DEPTH), samples, late)
    state, expected = in_time(filter, samples)
    same(found, expected)
    same(past.now, state)


def test_a_channel_measured_in_time_is_not_measured_again():
    filter, samples = spring_filter(), record()
    scale = jnp.ones((COUNT, 2))
    samples = dataclasses.replace(samples, mask=samples.mask.at[14].set(jnp.array([True, False])), scale=scale)
    both = dataclasses.replace(samples, mask=samples.mask.at[14].set(True))
    late = nothing_late()
    new = Late(samples.outputs[14].at[0].set(5.0), jnp.ones(2, bool), jnp.ones(2), jnp.sum(samples.elapsed[15:17]))
    late = jax.tree.map(lambda old, value: old.at[16].set(value), late, new)
    past, _ = delayed(DelayedFilter(filter, DEPTH), samples, late)
    same(past.now, in_time(filter, both)[0])


def test_it_belongs_to_the_nearest_sample():
    filter = spring_filter()
    full, lacking, late = held_back(record(), CASES["3 samples late"])
    margin = 0.45 * float(jnp.min(lacking.elapsed))
    state, _ = in_time(filter, full)
    for shift in (-margin, margin):
        moved = dataclasses.replace(late, age=late.age + jnp.where(jnp.arange(COUNT) == 15, shift, 0.0))
        same(delayed(DelayedFilter(filter, DEPTH), lacking, moved)[0].now, state)


def test_many_at_once_are_each_of_them():
    filter = DelayedFilter(spring_filter(), DEPTH)
    runs = [
        held_back(record(seed), CASES[case])[1:] for seed, case in enumerate(("2 samples late", "in another order"))
    ]
    many = jax.tree.map(lambda *leaves: jnp.stack(leaves), *runs)
    found = jax.vmap(lambda samples, late: delayed(filter, samples, late))(*many)
    for number, run in enumerate(runs):
        same(jax.tree.map(lambda leaf, number=number: leaf[number], found), delayed(filter, *run))


class Counting(AbstractGate):
    """Believes everything, and notes that it was asked."""

    asked: list = eqx.field(static=True)
    patience: int = eqx.field(static=True, default=0)

    def inside(self, innovation, deviations):
        jax.debug.callback(lambda: self.asked.append(True))
        return jnp.ones(innovation.shape, bool)


def test_a_sample_costs_one_step_and_a_late_measurement_one_more_for_each_sample_it_is_late():
    """On-line, compiled once."""
    asked = []
    filter = DelayedFilter(spring_filter(Counting(asked), ConstantNoise(1e-3 * jnp.eye(2))), DEPTH)
    _, lacking, late = held_back(record(), {12: (9, BOTH), 20: (15, BOTH), 25: (25, BOTH)})
    step = jax.jit(lambda past, sample, late: filter.step(past, sample, late))
    at = lambda tree, index: jax.tree.map(lambda leaf: leaf[index], tree)
    past = filter.start(filter.filter.start(jnp.zeros(2), jnp.array([2.0, 0.4]), 0.3 * jnp.eye(2)), at(lacking, 0))
    costs = []
    for k in range(COUNT):
        past, _ = step(past, at(lacking, k), at(late, k))
        jax.block_until_ready(past)
        jax.effects_barrier()
        # a step asks its gate twice: about what was expected, and about what was refused before
        costs.append(len(asked) // 2 - sum(costs))
    assert costs == [{12: 4, 20: 6}.get(k, 1) for k in range(COUNT)]
    assert step._cache_size() == 1  # pyright: ignore[reportAttributeAccessIssue, reportFunctionMemberAccess]


def test_float32_stays_float32():
    narrow = lambda leaf: leaf.astype(jnp.float32) if jnp.issubdtype(leaf.dtype, jnp.floating) else leaf
    filter, (_, lacking, late) = spring_filter(), held_back(record(), CASES["2 samples late"])
    wide, _ = delayed(DelayedFilter(filter, DEPTH), lacking, late)
    filter, lacking, late = (
        jax.tree.map(lambda leaf: narrow(leaf) if isinstance(leaf, jax.Array) else leaf, part)
        for part in (filter, lacking, late)
    )
    state = filter.start(
        jnp.zeros(2, jnp.float32), jnp.array([2.0, 0.4], jnp.float32), 0.3 * jnp.eye(2, dtype=jnp.float32)
    )
    memory = DelayedFilter(filter, DEPTH)
    past = memory.start(state, jax.tree.map(lambda leaf: leaf[0], lacking))
    past, seen = jax.lax.scan(lambda past, both: memory.step(past, *both), past, (lacking, late))
    floats = [leaf for leaf in jax.tree.leaves((past, seen)) if jnp.issubdtype(leaf.dtype, jnp.floating)]
    assert {leaf.dtype for leaf in floats} == {jnp.dtype(jnp.float32)}
    np.testing.assert_allclose(past.now.x, wide.now.x, rtol=0, atol=1e-4)
