"""The process-noise rules are what their equations say, give a root of Q whatever comes, and serve every filter."""

import dataclasses
from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from filter_cases import Linear, alone, at, sequence
from hypothesis import given, settings
from hypothesis import strategies as st
from rigs import driven, oscillator, stacked
from scipy.optimize import linprog

from jaxsub.filter import (
    ConstantNoise,
    Covariance,
    ExtendedKalmanFilter,
    FuzzyNoise,
    InnovationNoise,
    ModifiedKalmanFilter,
    RandomNoise,
    Residuals,
    SageHusaNoise,
    Sample,
    SquareRoot,
    VehicleProcess,
    on_line,
    over_runs,
    samples,
)
from jaxsub.simulation import synthetic

FORMS = {"qr": SquareRoot(), "svd": SquareRoot("svd"), "plain": Covariance()}
RULES = ["constant", "random", "fuzzy", "sage_husa", "innovation"]
LEARNT = ["fuzzy", "sage_husa", "innovation"]
LEAST, MOST = jnp.array([0.01, 0.02]), jnp.array([1.0, 2.0])
R_ROOT = np.linalg.cholesky([[0.04, 0.01], [0.01, 0.09]])


def rule(name, width=6):
    return {
        "constant": lambda: ConstantNoise(jnp.diag(0.1 * MOST)),
        "random": lambda: RandomNoise(0.2 * MOST, jax.random.key_data(jax.random.key(3))),
        "fuzzy": lambda: FuzzyNoise(LEAST, MOST, 0.2, width),
        "sage_husa": lambda: SageHusaNoise(0.1 * MOST, LEAST, MOST, 0.9),
        "innovation": lambda: InnovationNoise(LEAST, 2, width),
    }[name]()


def random_walk(noise, kind=ExtendedKalmanFilter, form=FORMS["qr"], count=2):
    """Two numbers that wander, each measured."""
    process = Linear(jnp.eye(count), jnp.eye(count))
    return kind(process, noise, jnp.asarray(R_ROOT[:count, :count]), jnp.eye(count), form)


def begun(filter):
    s = len(filter.x_root)
    return filter.start(jnp.zeros(s), jnp.zeros(0), jnp.zeros((0, 0)))


def walk(samples_, seed, spread=(0.3, 0.1)):
    """Measurements of a random walk with a jump in it, a fifth of them missing."""
    rng = np.random.default_rng(seed)
    x = np.cumsum(np.array(spread) * rng.normal(size=(samples_, 2)), axis=0)
    x[samples_ // 2 :] += 3.0
    return x + rng.normal(size=x.shape) @ R_ROOT.T, rng.random(x.shape) < 0.8


SPANS = st.one_of(st.just(0.0), st.floats(1e-6, 100.0))


@cache
def called(name):
    return jax.jit(lambda memory, residuals, elapsed: rule(name)(memory, residuals, elapsed))


SIZES = st.one_of(st.just(0.0), st.floats(-1e100, 1e100), st.floats(-10.0, 10.0))


@pytest.mark.parametrize("name", RULES)
@settings(max_examples=40, deadline=None, derandomize=True)
@given(numbers=st.lists(st.tuples(st.tuples(*[SIZES] * 8), st.booleans(), SPANS), min_size=1, max_size=8))
def test_q_is_positive_semi_definite_and_finite_whatever_comes(name, numbers):
    noise = rule(name)
    memory, call = noise.start(), called(name)
    for values, seen, elapsed in numbers:
        v = np.array(values)
        mask = jnp.full(2, seen)
        innovation, gain = jnp.where(mask, jnp.asarray(v[:2]), 0.0), jnp.asarray(v[2:6].reshape(2, 2) * 1e-50)
        residuals = Residuals(innovation, mask, jnp.asarray(R_ROOT), gain, gain @ innovation)
        memory, root = call(memory, residuals, jnp.asarray(elapsed))
        Q = np.asarray(root @ root.T)
        assert np.isfinite(Q).all()
        assert np.linalg.eigvalsh(Q / max(np.abs(Q).max(), 1e-300))[0] > -1e-12
        assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(memory))
        if name in ("fuzzy", "sage_husa"):
            assert (np.diag(Q) >= 0.999 * elapsed * np.asarray(LEAST) ** 2).all()
            assert (np.diag(Q) <= 1.001 * elapsed * np.asarray(MOST) ** 2).all()


@pytest.mark.parametrize("form", list(FORMS))
@pytest.mark.parametrize("kind", [ExtendedKalmanFilter, ModifiedKalmanFilter])
@pytest.mark.parametrize("name", RULES)
def test_p_stays_positive_definite_and_the_filter_is_kalmans_with_the_rules_q(name, kind, form):
    """Kalman's filter in NumPy, given the Q that the rule gave, over a thousand samples with gaps and a jump."""
    outputs, mask = walk(1000, 1)
    filter = random_walk(rule(name), kind, FORMS[form])

    def step(state, sample):
        Q_root = filter.noise(state.memory, state.residuals, sample.elapsed)[1]
        after, estimate = filter.step(state, sample)
        return after, (estimate, Q_root @ Q_root.T, filter.form.covariance(after.joint))

    record = sequence(np.zeros((1000, 2)), outputs, mask)
    _, (estimates, Q, P) = jax.jit(lambda s: jax.lax.scan(step, s, record))(begun(filter))
    assert not np.any(estimates.diverged)
    assert np.linalg.eigvalsh(np.asarray(P)).min() > 0.0
    x, plain = np.zeros(2), np.eye(2)
    for k in range(1000):
        plain = plain + np.asarray(Q[k])
        H, V = np.eye(2)[mask[k]], (R_ROOT @ R_ROOT.T)[np.ix_(mask[k], mask[k])]
        K = plain @ H.T @ np.linalg.inv(H @ plain @ H.T + V)
        x, plain = x + K @ (outputs[k][mask[k]] - H @ x), (np.eye(2) - K @ H) @ plain
    np.testing.assert_allclose(estimates.x[-1], x, atol=1e-8)
    np.testing.assert_allclose(P[-1], plain, atol=1e-10)
    np.testing.assert_allclose(estimates.noise_std[-1], np.sqrt(np.diag(Q[-1])), rtol=1e-9)


def expected(name, heard, width=6):
    """Q a second after the measurements `heard`, (time, since, innovation, mask, S, K), from the rules' equations."""
    last = heard[-width:]
    K = heard[-1][5]
    if name == "sage_husa":
        q = np.asarray(0.1 * MOST) ** 2
        for _, since, nu, _, S, gain in heard:
            q = np.clip(q + 0.1 * np.diag(gain @ (np.outer(nu, nu) - S) @ gain.T) / since, LEAST**2, MOST**2)
        return np.diag(q)
    if name == "innovation":
        count = np.maximum(sum(mask.astype(float) for _, _, _, mask, _, _ in last), 1.0)
        C = sum(np.outer(nu, nu) for _, _, nu, *_ in last) / np.sqrt(np.outer(count, count))
        Q = K @ C @ K.T / np.mean([since for _, since, *_ in last])
        return Q + np.diag(np.maximum(LEAST**2 - np.diag(Q), 0.0))
    t, q = np.array([time for time, *_ in last]) - last[0][0], []
    for x in np.array([gain @ nu for _, _, nu, _, _, gain in last]).T:
        ones = np.stack([np.ones_like(t), t], 1)
        limits = np.concatenate([np.hstack([ones, -0.8 * ones]), np.hstack([-ones, -0.8 * ones])])
        bounds = [(None, None)] * 2 + [(0.0, None)] * 2
        found = linprog([0.0, 0.0, len(t), t.sum()], limits, np.concatenate([x, -x]), bounds=bounds)
        q.append(abs(x[-1] * found.x[1]) if len(t) > 1 else 0.0)
    return np.diag(np.clip(q, LEAST**2, MOST**2))


@pytest.mark.parametrize("name", LEARNT)
def test_the_rules_are_their_equations(name):
    """At uneven times, where the fuzzy line has one optimum only; channels may be missing."""
    noise, rng = rule(name), np.random.default_rng(5)
    call = jax.jit(noise.__call__)
    memory, _ = call(noise.start(), Residuals.none(jnp.eye(2), jnp.asarray(R_ROOT)), jnp.asarray(0.7))
    heard, time, since = [], 0.7, 0.7
    for k in range(15):
        factor, K = np.linalg.cholesky(np.cov(rng.normal(size=(2, 5)))), 0.3 * rng.normal(size=(2, 2))
        mask = np.array([True, k % 3 > 0])
        nu, K = np.where(mask, rng.normal(size=2), 0.0), np.where(mask, K, 0.0)
        heard.append((time, since, nu, mask, factor @ factor.T, K))
        since = rng.uniform(0.2, 2.0)
        time += since
        residuals = Residuals(*map(jnp.asarray, (nu, mask, factor, K, K @ nu)))
        memory, root = call(memory, residuals, jnp.asarray(since))
        np.testing.assert_allclose(root @ root.T, since * expected(name, heard), rtol=1e-7, atol=1e-12)


LEAST_SMALL, MOST_LARGE = jnp.full(2, 0.01), jnp.full(2, 5.0)


@pytest.mark.parametrize(
    "noise",
    [
        SageHusaNoise(jnp.full(2, 0.03), LEAST_SMALL, MOST_LARGE, 0.98),
        SageHusaNoise(jnp.full(2, 1.5), LEAST_SMALL, MOST_LARGE, 0.98),
        InnovationNoise(LEAST_SMALL, 2, 200),
    ],
    ids=["sage_husa from below", "sage_husa from above", "innovation"],
)
def test_from_a_wrong_start_they_find_the_true_q(noise):
    """Random walks of standard deviations 0.3 and 0.1 a step: root Q is up to fifteen times off at first.

    The measure: root mean Q over 32 records, late in each.
    """
    rng, length, truth = np.random.default_rng(2), 1500, np.array([0.3, 0.1])
    x = np.cumsum(truth * rng.normal(size=(32, length, 2)), axis=1)
    outputs = x + rng.normal(size=x.shape) @ R_ROOT.T
    filter = random_walk(noise)

    def follow(z):
        record = Sample(jnp.zeros((length, 2)), jnp.ones(length), z, jnp.ones(z.shape, bool))
        return jax.lax.scan(lambda s, sample: filter.step(s, sample), begun(filter), record)[1].noise_std

    Q = np.asarray(jax.jit(jax.vmap(follow))(jnp.asarray(outputs)))[:, 1000:] ** 2
    np.testing.assert_allclose(np.sqrt(Q.mean((0, 1))), truth, rtol=0.15)


@pytest.mark.parametrize("name", ["constant", *LEARNT])
def test_densities_a_second_do_not_depend_on_how_often_time_is_updated(name):
    """Four time updates of a quarter of a second and then one measurement, as one of a second."""
    filter = random_walk(rule(name))
    z = walk(30, 3)[0]
    whole = sequence(np.zeros((30, 2)), z)
    fine = Sample(
        jnp.zeros((120, 2)),
        jnp.full(120, 0.25),
        jnp.asarray(z.repeat(4, 0)),
        jnp.asarray(np.arange(120)[:, None] % 4 == np.full(2, 3)),
    )
    (one, coarse), (other, often) = (
        over_runs(filter, begun(filter), alone(s), jnp.zeros((1, 2))) for s in (whole, fine)
    )
    np.testing.assert_allclose(other.x, one.x, rtol=1e-9)
    for part in range(4):
        std = often.noise_std[0, part::4] / np.sqrt(0.25)
        np.testing.assert_allclose(std, coarse.noise_std[0], rtol=1e-8)


@pytest.mark.parametrize("name", LEARNT)
def test_missing_measurements_teach_nothing(name):
    filter = random_walk(rule(name))
    step = on_line(filter)
    record, state = sequence(np.zeros((20, 2)), walk(20, 4)[0]), begun(filter)
    for k in range(20):
        state, estimate = step(state, at(record, k))
    gone = dataclasses.replace(at(record, 19), mask=jnp.zeros(2, bool), outputs=jnp.full(2, 1e6))
    # what the last measurement taught acts from the next interval on
    state, _ = step(state, gone)
    learnt = estimate = None
    for _ in range(5):
        before = state
        state, estimate = step(state, gone)
        learnt = estimate.noise_std if learnt is None else learnt
        np.testing.assert_array_equal(estimate.noise_std, learnt)
        np.testing.assert_array_equal(state.x, before.x)


@pytest.mark.parametrize("name", RULES)
def test_many_filters_at_once_are_each_of_them_and_a_restart_forgets(name):
    filter = random_walk(rule(name))
    records = [sequence(np.zeros((25, 2)), *walk(25, seed)) for seed in range(3)]
    together = jax.tree.map(lambda *leaves: jnp.stack(leaves), *records)
    run = lambda record: over_runs(filter, begun(filter), alone(record), jnp.zeros((1, 2)))[1]
    every = jax.jit(jax.vmap(run))(together)
    step = on_line(filter)
    state = begun(filter)
    for i, record in enumerate(records):
        # the filter goes on from one record to the next: only the restart makes it forget
        state = filter.restart(state, jnp.zeros(2))
        for k in range(25):
            state, estimate = step(state, at(record, k))
            np.testing.assert_allclose(estimate.noise_std, every.noise_std[i, 0, k], rtol=1e-9, atol=1e-12)
            np.testing.assert_allclose(estimate.x, every.x[i, 0, k], rtol=1e-9, atol=1e-12)
    assert step._cache_size() == 1  # pyright: ignore[reportFunctionMemberAccess]


@pytest.mark.parametrize("kind", [ExtendedKalmanFilter, ModifiedKalmanFilter])
@pytest.mark.parametrize("name", RULES)
def test_a_vehicle_is_followed_with_every_rule(name, kind):
    """An oscillator whose stiffness and damping are 20 % off: they come closer, and the state is near the measured."""
    vehicle = oscillator()
    inputs = [driven(vehicle, 0.2 * np.arange(150), 1, amplitude=1.0)]
    runs = stacked(vehicle, synthetic(vehicle, inputs, seed=1))
    scale = jnp.array([0.02, 0.01])
    noise = {
        "constant": ConstantNoise(jnp.diag(0.25 * scale)),
        "random": RandomNoise(0.5 * scale, jax.random.key_data(jax.random.key(0))),
        "fuzzy": FuzzyNoise(0.1 * scale, 5.0 * scale),
        "sage_husa": SageHusaNoise(0.25 * scale, 0.05 * scale, 5.0 * scale),
        "innovation": InnovationNoise(0.1 * scale, 2),
    }[name]
    filter = kind(VehicleProcess.of(vehicle), noise, jnp.diag(jnp.array([0.01, 0.02])), jnp.diag(scale))
    theta = jnp.array([0.2, -0.2, 0.2])
    state = filter.start(jnp.zeros(2), theta, 0.5 * jnp.eye(3))
    last, estimates = jax.jit(lambda s: over_runs(filter, s, samples(runs), jnp.zeros((1, 2))))(state)
    assert not np.any(estimates.diverged)
    assert np.linalg.norm(last.theta) < 0.4 * np.linalg.norm(theta)
    assert np.linalg.eigvalsh(np.asarray(filter.form.covariance(last.joint))).min() > 0.0


@pytest.mark.parametrize("name", LEARNT)
def test_the_likelihood_has_a_gradient_by_the_rules_own_numbers(name):
    """By the start and the limits of a rule, against central differences; the first sample has no time before it."""
    z = walk(12, 6)[0]
    record = dataclasses.replace(
        sequence(np.zeros((12, 2)), z), elapsed=jnp.concatenate([jnp.zeros(1), jnp.full(11, 0.5)])
    )

    def nll(log_size):
        noise = rule(name, 4)
        factor = jnp.exp(log_size)
        changed = (
            dataclasses.replace(noise, first=factor * noise.first)
            if isinstance(noise, SageHusaNoise)
            else dataclasses.replace(noise, least=factor * noise.least)
        )
        filter = random_walk(changed, form=FORMS["plain"])
        _, e = jax.lax.scan(lambda s, sample: filter.step(s, sample), begun(filter), record)
        white = jax.vmap(jnp.linalg.solve)(e.factor, e.innovation)
        return 0.5 * jnp.sum(white**2) + jnp.sum(jnp.log(jnp.diagonal(e.factor, axis1=1, axis2=2)))

    value = jax.jit(nll)
    slope = float(jax.jit(jax.grad(nll))(0.1))
    np.testing.assert_allclose(slope, (value(0.1 + 1e-5) - value(0.1 - 1e-5)) / 2e-5, rtol=1e-4, atol=1e-7)
