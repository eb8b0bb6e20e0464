"""Every effect does nothing at amplitude zero, is linear in its amplitudes, and works under jit, vmap and derivatives.

The numbers are those of every candidate on a body of six degrees of freedom and on a rig of four coordinates; what
takes a compilation is tried on one candidate of each kind.
"""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from samples import BODY, RIG, all_candidates, motion, name, one_of_each, sized, still

from jaxsub.effects import (
    VOCABULARY,
    AbstractActuator,
    AbstractForce,
    AbstractInstrument,
    AbstractMemory,
    SensorMisalignment,
    amplitudes,
    candidates,
    number_fields,
    options,
    parameter_table,
    with_numbers,
)
from jaxsub.units import si_unit

# diagnoses name effects by these, so none may be renamed; the last two came later
NAMES = """
quadratic-damping cubic-damping crossflow-drag coriolis-coupling turning-speed-loss speed-scaling hull-asymmetry
fluid-memory trim-offset buoyancy-error hull-compressibility density-stratification thermal-expansion mass-shift
actuator-lag actuator-delay actuator-rate-limit actuator-saturation actuator-deadband actuator-backlash
actuator-misalignment control-surface-stall propeller-race propeller-torque propeller-asymmetry thrust-loss
thruster-cross-coupling current wave-forcing free-surface-suction bottom-suction tether-drag coulomb-friction
cubic-stiffness hysteresis saturation sensor-bias sensor-scale sensor-delay sensor-misalignment sensor-lever-arm
sensor-saturation sensor-rectification sensor-drift asymmetric-damping actuator-gain
"""
PAIRS, EACH = all_candidates(), one_of_each()
of = lambda kind, pairs: [pair for pair in pairs if isinstance(pair[1], kind)]
TIMES = jnp.asarray(np.cumsum(np.random.default_rng(4).uniform(0.1, 1.0, 40)))
COMMAND = jnp.asarray(np.repeat(np.random.default_rng(6).normal(size=(39, 1)), 3, 1))


def shown(now, known):
    """True outputs of every channel along a motion."""
    return {c: jnp.asarray(np.random.default_rng(i).normal(size=40)) for i, c in enumerate(known.channels)}


def all_channels(effect, times, truth, now):
    """What an instrument shows of its channels, (c, *k)."""
    found = effect.show(times, truth, now)
    return jnp.stack([found[channel] for channel in effect.channels])


def numbers_of(effect):
    return jnp.asarray([getattr(effect, field.name) for field in number_fields(effect)])


def with_vector(effect, vector):
    return with_numbers(effect, dict(zip([f.name for f in number_fields(effect)], vector, strict=True)))


def test_the_vocabulary_has_every_name_and_every_effect_is_tried_here():
    assert sorted(kind.name for kind in VOCABULARY) == sorted(NAMES.split())
    assert {type(effect) for _, effect in PAIRS} == set(VOCABULARY)


def test_every_force_on_every_candidate_is_zero_at_amplitude_zero_and_linear_in_its_amplitudes():
    rng = np.random.default_rng(2)
    for known, effect in of(AbstractForce, PAIRS):
        now, count = motion(known), len(amplitudes(effect))
        assert count > 0
        one, two = rng.normal(size=(2, count))
        for part in sized(effect, np.zeros(count)).force(now).values():
            np.testing.assert_array_equal(part, 0.0)
        first, second, both = (sized(effect, s).force(now) for s in (one, two, one - 3.0 * two))
        assert set(both) & set(effect.where) or effect.where[0].startswith("input:")
        for equation, part in both.items():
            np.testing.assert_allclose(part, first[equation] - 3.0 * second[equation], rtol=1e-10, atol=1e-10)
        assert all(np.abs(part).max() > 0.0 for part in both.values()), name((known, effect))


def test_a_force_is_the_same_on_numpy_arrays_under_jit_and_under_vmap():
    for known, effect in of(AbstractForce, EACH):
        sizes = np.random.default_rng(3).normal(size=len(amplitudes(effect)))
        effect, now = sized(effect, sizes), motion(known)
        one = lambda i, now=now: jax.tree.map(lambda leaf: leaf[i] if jnp.ndim(leaf) == 1 else leaf, now)
        mapped = jax.jit(jax.vmap(lambda i, effect=effect, one=one: effect.force(one(i))))(jnp.arange(40))
        plain = jax.tree.map(np.asarray, effect).force(jax.tree.map(np.asarray, now))
        for equation, part in effect.force(now).items():
            np.testing.assert_allclose(mapped[equation], part, rtol=1e-12, atol=1e-12)
            np.testing.assert_allclose(plain[equation], part, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("pair", of(AbstractForce, EACH), ids=name)
def test_every_derivative_of_a_force_is_finite_also_at_rest(pair):
    known, effect = pair
    effect = sized(effect, np.random.default_rng(3).normal(size=len(amplitudes(effect))))
    now = motion(known)

    @jax.jit
    def slopes(at):
        along = lambda vector, leaves: with_vector(effect, vector).force(jax.tree.unflatten(tree, leaves))
        leaves, tree = jax.tree.flatten(at)
        leaves = [jnp.asarray(leaf) for leaf in leaves]
        ones = jax.tree.map(jnp.ones_like, (numbers_of(effect), leaves))
        return jax.jvp(along, (numbers_of(effect), leaves), ones)[1]

    for at in (now, still(now)):
        assert all(np.isfinite(part).all() for part in slopes(at).values())


def test_every_sensor_shows_the_truth_at_amplitude_zero_and_errs_in_proportion():
    for known, effect in of(AbstractInstrument, PAIRS):
        if not amplitudes(effect):
            continue
        now = motion(known)
        truth = shown(now, known)
        error = lambda size, e=effect, now=now, truth=truth: (
            all_channels(sized(e, [size]), TIMES, truth, now) - np.stack([truth[c] for c in e.channels])
        )
        np.testing.assert_array_equal(error(0.0), 0.0)
        assert np.abs(error(0.5)).max() > 1e-3, name((known, effect))
        if isinstance(effect, SensorMisalignment):
            # a turn is the one that is in proportion only while it is small
            small = error(1e-4)
            np.testing.assert_allclose(error(-3e-4), -3.0 * small, atol=1e-3 * np.abs(small).max())
        else:
            np.testing.assert_allclose(error(-1.5), -3.0 * error(0.5), atol=1e-10)


@pytest.mark.parametrize("pair", of(AbstractInstrument, EACH), ids=name)
def test_a_sensor_is_the_same_under_vmap_and_its_derivatives_are_finite(pair):
    known, effect = pair
    runs = [motion(known, seed=seed) for seed in (1, 2)]
    truths = [shown(now, known) for now in runs]
    both = lambda parts: jax.tree.map(lambda *leaves: jnp.stack([jnp.asarray(leaf) for leaf in leaves]), *parts)
    times = jnp.stack([TIMES, 2.0 * TIMES])
    batch = jax.jit(jax.vmap(partial(all_channels, effect)))(times, both(truths), both(runs))
    for i, (now, truth) in enumerate(zip(runs, truths, strict=True)):
        np.testing.assert_allclose(batch[i], all_channels(effect, times[i], truth, now), rtol=1e-12, atol=1e-12)
    at = numbers_of(effect)
    for now in (runs[0], still(runs[0])):
        slope = jax.jacfwd(lambda vector, now=now: all_channels(with_vector(effect, vector), TIMES, truths[0], now))(at)
        assert np.isfinite(slope).all()
    # a batch of runs at once, as a vehicle asks for them
    static = jax.tree.map(lambda leaf: jnp.stack([leaf, leaf]) if jnp.ndim(leaf) == 1 else leaf, runs[0])
    twice = {channel: jnp.stack([value, value]) for channel, value in truths[0].items()}
    np.testing.assert_allclose(
        all_channels(effect, jnp.stack([TIMES, TIMES]), twice, static)[:, 1],
        all_channels(effect, TIMES, truths[0], runs[0]),
    )


@pytest.mark.parametrize("pair", of(AbstractActuator, EACH), ids=name)
def test_an_actuator_is_the_same_under_vmap_and_its_derivatives_are_finite(pair):
    _, effect = pair
    answer = jax.jit(lambda vector, nodes: with_vector(effect, vector).respond(TIMES, nodes))
    at = numbers_of(effect)
    pair_of_runs = jax.vmap(answer, (None, 0))(at, jnp.stack([COMMAND, -2.0 * COMMAND]))
    np.testing.assert_allclose(pair_of_runs[1], answer(at, -2.0 * COMMAND), rtol=1e-12, atol=1e-12)
    assert np.abs(answer(at + 0.1, COMMAND) - COMMAND).max() > 1e-3
    for nodes in (COMMAND, 0.0 * COMMAND):
        assert np.isfinite(jax.jacfwd(answer)(at, nodes)).all()
        assert np.isfinite(jax.jvp(lambda nodes: answer(at, nodes), (nodes,), (jnp.ones_like(nodes),))[1]).all()
    for field in amplitudes(effect):
        np.testing.assert_array_equal(with_numbers(effect, {field: 0.0}).respond(TIMES, COMMAND), COMMAND)


@pytest.mark.parametrize("known", [BODY, RIG], ids=lambda known: known.kind)
def test_candidates_differ_in_label_or_shape_and_so_do_their_parameters(known):
    shapes = lambda e: tuple(float(getattr(e, f.name)) for f in number_fields(e) if f.metadata["role"] == "shape")
    found = [(effect.label, shapes(effect)) for effect in candidates(known)]
    assert len(found) == len(set(found))
    by_label = {effect.label: effect for effect in candidates(known)}
    rows = [row.name for effect in by_label.values() for row in parameter_table(effect).values()]
    assert len(rows) == len(set(rows))
    states = [state for e in by_label.values() if isinstance(e, AbstractMemory) for state in e.states]
    assert len(states) == len(set(states))


def test_what_every_candidate_says_of_itself_can_be_read():
    for known, effect in PAIRS:
        for unit in effect.units().values():
            si_unit(unit)
        acted_on = {*known.equations, *(f"input:{a}" for a in known.actuators)}
        assert set(effect.where) & {*acted_on, *(f"sensor:{c}" for c in known.channels)}
        assert effect.expression
        fields = {field.name for field in number_fields(effect)}
        assert set(effect.symbols()) == set(effect.units()) == set(effect.signs()) == fields
        assert "Source:" in type(effect).__doc__
        assert all(isinstance(option, str | float | tuple) for option in options(effect).values())
        shapes = [getattr(effect, f.name) for f in number_fields(effect) if f.metadata["role"] == "shape"]
        assert all(value > 0.0 for value in shapes)
