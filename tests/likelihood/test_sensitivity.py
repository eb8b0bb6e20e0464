"""The linearised model's columns are the derivatives of the simulation: of coefficients, initial states and forces."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from rigs import driven, stacked

from jaxsub.effects import ActuatorLag, HullAsymmetry, QuadraticDamping, SensorScale
from jaxsub.likelihood import errors, force_columns, linearise_runs
from jaxsub.recording import Recording
from jaxsub.simulation import simulate, synthetic
from jaxsub.vehicle.catalogue import dsrv

rng = np.random.default_rng(7)


def vehicle_of_everything():
    """A body with a force, an actuator and a sensor effect, none of them at zero."""
    vehicle = dsrv().with_effect(QuadraticDamping("pitch", jnp.asarray(-3e4)))
    vehicle = vehicle.with_effect(HullAsymmetry("heave", jnp.asarray(40.0)))
    return vehicle.with_effect(ActuatorLag("stern_plane", 0.4)).with_effect(SensorScale("q", jnp.asarray(0.05)))


def with_gaps(recording):
    """The recording with a tenth of its outputs missing."""
    gap = lambda name, column: np.where((rng.random(len(column)) < 0.1) & (name != "delta_s"), np.nan, column)
    return Recording("gaps", recording.times, {n: gap(n, c) for n, c in recording.columns.items()}, "gaps")


@pytest.fixture(scope="module")
def case():
    """A vehicle, two uneven runs of unequal length with gaps, initial states, and the linearised model."""
    vehicle = vehicle_of_everything()
    spans = [0.2 * np.arange(25), np.cumsum(rng.choice([0.1, 0.3, 0.45], 18))]
    inputs = [driven(vehicle, times, seed, hold=4) for seed, times in enumerate(spans)]
    runs = stacked(vehicle, [with_gaps(recording) for recording in synthetic(vehicle, inputs, seed=7)])
    start = jnp.asarray(0.02 * rng.normal(size=(2, 4)))
    return vehicle, runs, start, linearise_runs(vehicle, runs, start)


def moved(vehicle, runs, start):
    """Errors as a function of the free numbers, and those numbers."""
    values = vehicle.values()
    names = [row.name for row in vehicle.layout.free]
    at = jnp.stack([values[name] for name in names])
    return jax.jit(lambda theta: errors(vehicle.with_values(dict(zip(names, theta, strict=True))), runs, start)), at


def test_parameter_columns_are_the_jacobian_of_the_errors(case):
    vehicle, runs, start, model = case
    assert 0 < int(jnp.sum(~runs.mask)) < runs.mask.size / 2
    assert not bool(runs.live.all())
    f, theta = moved(vehicle, runs, start)
    np.testing.assert_allclose(model.error, f(theta), rtol=1e-12, atol=1e-14)
    columns = -model.theta * runs.mask[..., None]
    assert columns.shape[-1] == len(vehicle.layout.free) == 10
    assert (np.abs(columns).max((0, 1, 2)) > 0.0).all()
    exact = jax.jacfwd(f)(theta)
    scale = np.abs(exact).max((0, 1, 2))
    np.testing.assert_allclose(columns / scale, exact / scale, atol=1e-11)
    for i, size in enumerate(1e-4 * np.abs(theta)):
        step = size * jnp.eye(len(theta))[i]
        quotient = (f(theta + step) - f(theta - step)) / (2.0 * size)
        np.testing.assert_allclose(columns[..., i] / scale[i], quotient / scale[i], atol=1e-5)


def test_initial_state_columns_are_the_jacobian_of_each_runs_errors(case):
    vehicle, runs, start, model = case
    exact = jax.jit(jax.jacfwd(lambda s: errors(vehicle, runs, s)))(start)
    np.testing.assert_allclose(exact[0, :, :, 1], 0.0, atol=0.0)
    own = jnp.stack([exact[r, :, :, r] for r in range(2)])
    np.testing.assert_allclose(-model.start * runs.mask[..., None], own, rtol=1e-10, atol=1e-12)


def test_force_columns_are_the_effect_of_a_constant_force(case):
    vehicle, runs, start, model = case
    value = vehicle.values()["hull-asymmetry[heave].Z_0"]
    simulated = eqx.filter_jit(simulate)
    pushed = lambda force: simulated(vehicle.with_values({"hull-asymmetry[heave].Z_0": force}), runs, start)
    exact = jax.jvp(pushed, (value,), (jnp.ones(()),))[1]
    force = jnp.zeros((2, 24, 2, 1)).at[:, :, 0].set(1.0)
    found = force_columns(model, force, force)[..., 0]
    inside = np.arange(25) < np.array([25, 18])[:, None]
    np.testing.assert_allclose(found[inside], exact[inside], rtol=1e-9, atol=1e-14)
    quotient = (pushed(value + 50.0) - pushed(value - 50.0))[inside] / 100.0
    np.testing.assert_allclose(found[inside], quotient, rtol=1e-4, atol=1e-4 * np.abs(quotient).max())


def test_a_force_that_changes_along_the_run_is_the_sum_of_its_parts(case):
    *_, model = case
    force = jnp.asarray(rng.normal(size=(2, 24, 2, 3)))
    later = force.at[:, :10].set(0.0)
    whole, late = force_columns(model, force, force), force_columns(model, later, later)
    np.testing.assert_array_equal(late[:, :11], 0.0)
    np.testing.assert_allclose(whole - late, force_columns(model, force - later, force - later), atol=1e-12)
