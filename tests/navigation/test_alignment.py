"""An attitude at rest is found from gravity and the field, and what cannot be told is said to be unknown."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from jaxsub.navigation.alignment import UNKNOWN, MagneticField, aligned

G = 9.80665
FIELD = np.array([18.0, 0.0, 44.0])
found_at = jax.jit(aligned)


def readings(attitude):
    """What a still unit shows: minus gravity, and the field, in body axes."""
    back = attitude.inv()
    return jnp.asarray(back.apply([0.0, 0.0, -G])), jnp.asarray(back.apply(FIELD))


def as_rotation(q):
    return Rotation.from_quat(np.asarray(q), scalar_first=True)


@pytest.mark.parametrize("seed", range(5))
def test_any_attitude_is_found_again(seed):
    attitude = Rotation.random(rng=np.random.default_rng(seed))
    found = found_at(*readings(attitude))
    assert (as_rotation(found.q).inv() * attitude).magnitude() < 1e-9
    assert found.level and found.heading
    np.testing.assert_allclose(found.field, FIELD, atol=1e-9)
    np.testing.assert_array_equal(found.deviations(0.02, 0.1), [0.02, 0.02, 0.1])


@pytest.mark.parametrize("pitch", [-90.0, 90.0])
def test_nose_or_tail_up_is_found_too(pitch):
    attitude = Rotation.from_euler("ZYX", [40.0, pitch, 0.0], degrees=True)
    found = found_at(*readings(attitude))
    assert (as_rotation(found.q).inv() * attitude).magnitude() < 1e-7
    assert found.level and found.heading


@pytest.mark.parametrize("force", [np.zeros(3), np.full(3, np.nan), np.array([0.0, 0.3, -0.4])])
def test_in_free_fall_nothing_is_known(force):
    found = found_at(jnp.asarray(force), jnp.asarray(FIELD))
    np.testing.assert_array_equal(found.q, [1.0, 0.0, 0.0, 0.0])
    assert not found.level and not found.heading
    np.testing.assert_array_equal(found.deviations(0.02, 0.1), 3 * [UNKNOWN])


@pytest.mark.parametrize("field", [np.zeros(3), np.array([0.0, 0.0, 50.0]), np.array([1.0, 0.0, 50.0])])
def test_a_vertical_field_or_none_leaves_the_heading_unknown_alone(field):
    attitude = Rotation.from_euler("ZYX", [0.0, 10.0, -20.0], degrees=True)
    found = found_at(readings(attitude)[0], jnp.asarray(attitude.inv().apply(field)))
    assert found.level and not found.heading
    assert (as_rotation(found.q).inv() * attitude).magnitude() < 1e-9
    np.testing.assert_array_equal(found.deviations(0.02, 0.1), [0.02, 0.02, UNKNOWN])


def test_a_field_that_is_not_finite_is_none():
    found = found_at(jnp.array([0.0, 0.0, -G]), jnp.array([18.0, np.inf, 44.0]))
    np.testing.assert_array_equal(found.q, [1.0, 0.0, 0.0, 0.0])
    assert found.level and not found.heading


@pytest.mark.parametrize("force", [[0.0, 0.0, -G], [G, 0.0, 0.0], [0.0, 0.0, 0.0]])
def test_derivatives_are_finite_where_angles_are_not_defined(force):
    slopes = jax.jacfwd(lambda f, m: aligned(f, m).q, argnums=(0, 1))(jnp.asarray(force), jnp.array([0.0, 0.0, 50.0]))
    assert all(np.all(np.isfinite(slope)) for slope in slopes)


def test_the_heading_std_is_that_of_isotropic_disturbances_of_the_size_seen():
    rng, spread, size = np.random.default_rng(3), 1.0, 3.0
    field = MagneticField(FIELD[0], FIELD[2], spread)
    seen = FIELD + rng.normal(size=(40_000, 3)) * size
    told = np.asarray(jax.vmap(field.heading_std)(jnp.asarray(seen)))
    errors = np.arctan2(seen[:, 1], seen[:, 0])
    # east is as large as north and down, and one degree of freedom is seen half as well as two
    assert np.sqrt(np.mean(errors**2)) == pytest.approx(np.sqrt(np.mean(told**2) - (spread / 18.0) ** 2), rel=0.1)
    # of more disturbed readings it says more
    strong = told > np.median(told)
    assert np.std(errors[strong]) < 1.5 * np.sqrt(np.mean(told[strong] ** 2))


def test_the_undisturbed_field_has_its_spread_and_a_vertical_one_no_heading():
    field = MagneticField(18.0, 44.0, 1.5)
    turned = jnp.array([18.0 * np.cos(0.7), 18.0 * np.sin(0.7), 44.0])
    assert field.heading_std(turned) == pytest.approx(1.5 / 18.0)
    assert field.heading_std(jnp.array([0.0, 0.0, 44.0])) == pytest.approx(UNKNOWN)
