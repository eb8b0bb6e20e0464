"""Every effect does nothing at amplitude zero, is linear in its amplitudes, and works under jit and vmap."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from samples import BODY, RIG, all_candidates, motion, name, sized

from jaxsub.effects import (
    VOCABULARY,
    AbstractActuator,
    AbstractForce,
    AbstractSensor,
    amplitudes,
    candidates,
    number_fields,
    options,
    parameter_table,
)
from jaxsub.units import si_unit

PAIRS = all_candidates()
FORCES, SENSORS = ([pair for pair in PAIRS if isinstance(pair[1], kind)] for kind in (AbstractForce, AbstractSensor))


def test_every_effect_of_the_vocabulary_is_tried_here():
    assert {type(effect) for _, effect in PAIRS} == set(VOCABULARY)
    assert len({kind.name for kind in VOCABULARY}) == len(VOCABULARY)


@pytest.mark.parametrize("pair", FORCES, ids=name)
def test_force_is_zero_at_amplitude_zero_and_linear_in_its_amplitudes(pair):
    known, effect = pair
    now = motion(known)
    rng = np.random.default_rng(2)
    count = len(amplitudes(effect))
    assert count > 0
    one, two = rng.normal(size=(2, count))
    for part in sized(effect, np.zeros(count)).force(now).values():
        np.testing.assert_array_equal(part, 0.0)
    first, second, both = (sized(effect, s).force(now) for s in (one, two, one - 3.0 * two))
    assert set(both) & set(effect.where)
    for equation, part in both.items():
        np.testing.assert_allclose(part, first[equation] - 3.0 * second[equation], rtol=1e-11, atol=1e-11)
    assert all(np.abs(part).max() > 0.0 for part in both.values())


@pytest.mark.parametrize("pair", FORCES, ids=name)
def test_force_is_the_same_under_jit_and_vmap(pair):
    known, effect = pair
    effect = sized(effect, np.random.default_rng(3).normal(size=len(amplitudes(effect))))
    now = motion(known)
    one = lambda i: jax.tree.map(lambda leaf: leaf[i] if jnp.ndim(leaf) == 1 else leaf, now)
    mapped = jax.jit(jax.vmap(lambda i: effect.force(one(i))))(jnp.arange(40))
    for equation, part in effect.force(now).items():
        np.testing.assert_allclose(mapped[equation], part, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("pair", SENSORS, ids=name)
def test_sensor_shows_the_truth_at_amplitude_zero_and_errs_in_proportion(pair):
    _, effect = pair
    rng = np.random.default_rng(4)
    times, truth = jnp.asarray(np.cumsum(rng.uniform(0.1, 1.0, (2, 30)), 1)), jnp.asarray(rng.normal(size=(2, 30)))
    np.testing.assert_array_equal(sized(effect, [0.0]).measure(times, truth), truth)
    error = sized(effect, [0.5]).measure(times, truth) - truth
    assert np.abs(error).max() > 0.1
    np.testing.assert_allclose(sized(effect, [-1.5]).measure(times, truth) - truth, -3.0 * error, atol=1e-12)
    mapped = jax.jit(jax.vmap(sized(effect, [0.5]).measure))(times, truth)
    np.testing.assert_allclose(mapped, truth + error, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("known", [BODY, RIG], ids=lambda known: known.kind)
def test_candidates_differ_in_label_or_shape_and_so_do_their_parameters(known):
    shapes = lambda e: tuple(float(getattr(e, f.name)) for f in number_fields(e) if f.metadata["role"] == "shape")
    found = [(effect.label, shapes(effect)) for effect in candidates(known)]
    assert len(found) == len(set(found))
    by_label = {effect.label: effect for effect in candidates(known)}
    rows = [row.name for effect in by_label.values() for row in parameter_table(effect).values()]
    assert len(rows) == len(set(rows))


@pytest.mark.parametrize("pair", PAIRS, ids=name)
def test_what_a_candidate_says_of_itself_can_be_read(pair):
    known, effect = pair
    for unit in effect.units().values():
        si_unit(unit)
    acted_on = {*known.equations, *(f"input:{a}" for a in known.actuators), *(f"sensor:{c}" for c in known.channels)}
    assert set(effect.where) & acted_on
    assert effect.expression
    assert set(effect.symbols()) == {field.name for field in number_fields(effect)}
    assert "Source:" in type(effect).__doc__
    assert isinstance(effect, AbstractForce | AbstractActuator | AbstractSensor)
    assert all(isinstance(option, str | float | tuple) for option in options(effect).values())
