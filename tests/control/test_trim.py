"""A trim is where the plant stays, its derivatives are those of the implicit function, and linear forms hold there."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from control_cases import concealing
from rigs import coupled
from scipy.linalg import expm
from scipy.optimize import fsolve

from jaxsub.control import Plant, discretise, linearisation_error, linearise, linearise_rates, require_trim, trim
from jaxsub.effects import FluidMemory, HullAsymmetry, TrimOffset
from jaxsub.errors import InputError
from jaxsub.parameters import number
from jaxsub.vehicle.catalogue import nps_auv_ii

DT = 0.2
RUN = eqx.filter_jit(Plant.run)


def heavy():
    """The NPS AUV with a moment that its fins have to hold, and a force that remembers."""
    vehicle = nps_auv_ii().with_effect(TrimOffset("x", number(0.02))).with_effect(HullAsymmetry("yaw", number(150.0)))
    return vehicle.with_effect(FluidMemory("heave", number(-300.0), number(2.0)))


@pytest.fixture(scope="module")
def plant():
    return discretise(heavy(), DT)


@pytest.fixture(scope="module")
def found(plant):
    return require_trim(plant, trim(plant))


def test_plant_stays_where_it_is_trimmed(plant, found):
    end = RUN(plant, found.x, jnp.tile(found.u, (200, 1)))[-1]
    np.testing.assert_allclose(end, found.x, atol=1e-6)
    assert float(jnp.max(jnp.abs(found.u))) > 0.02  # it did not start there


def test_trim_is_the_one_that_scipy_finds_in_the_equations_of_motion(plant, found):
    vehicle = plant.vehicle
    names = plant.states

    @jax.jit
    def equations(w):
        state = jnp.zeros(len(names)).at[0].set(w[0]).at[2].set(w[1])  # surge and heave
        state = state.at[names.index("theta")].set(w[2]).at[names.index("memory_heave")].set(w[1])
        state = state.at[1].set(w[3])
        signals = jnp.concatenate([w[4:7], jnp.zeros(1)])
        rates = vehicle.acceleration(state, signals)
        descent = vehicle.position_rates(vehicle.motion(state, signals))["z"]
        return jnp.append(rates, descent)

    w = fsolve(lambda w: np.asarray(equations(jnp.asarray(w))), [1.832, 0, 0, 0, 0, 0, 0], xtol=1e-12)
    chosen = [names.index(n) for n in ("u", "w", "theta", "v")]
    np.testing.assert_allclose(found.x[jnp.array(chosen)], w[:4], atol=1e-8)
    np.testing.assert_allclose(found.u, w[4:7], atol=1e-8)


@pytest.mark.long
def test_derivatives_of_a_trim_are_those_of_finite_differences(plant):
    names = ("M_delta_e", "N_delta_r", "trim-offset[x].delta_x_B")
    values = {name: plant.vehicle.values()[name] for name in names}
    deflections = lambda values: trim(plant.with_values(values)).u
    by = jax.jit(jax.jacrev(deflections))(values)
    for name in names:
        h = 1e-4 * jnp.abs(values[name])
        ends = [deflections(values | {name: values[name] + side * h}) for side in (1.0, -1.0)]
        np.testing.assert_allclose(by[name] * h, (ends[0] - ends[1]) / 2.0, rtol=1e-4, atol=1e-11, err_msg=name)


def test_turn_may_be_wanted(plant):
    turning = require_trim(plant, trim(plant, {"depth_rate": 0.0, "heading_rate": 0.02, "phi": 0.0}))
    x = RUN(plant, turning.x, jnp.tile(turning.u, (200, 1)))[-1]
    psi, phi, z = (plant.states.index(name) for name in ("psi", "phi", "z"))
    assert float(x[psi] - turning.x[psi]) == pytest.approx(0.02 * 200 * DT, abs=1e-6)
    np.testing.assert_allclose([x[phi], x[z]], 0.0, atol=1e-6)


def test_sampled_linear_form_is_the_exponential_of_the_continuous_one(plant, found):
    still, sampled = linearise_rates(plant, found.x, found.u), linearise(plant, found.x, found.u)
    s, m = still.B.shape
    block = np.zeros((s + m, s + m))
    block[:s] = np.hstack([still.A, still.B])
    whole = expm(DT * block)
    # the step is exact where damping acts, and of order four elsewhere
    np.testing.assert_allclose(sampled.A, whole[:s, :s], atol=3e-5)
    np.testing.assert_allclose(sampled.B, whole[:s, s:], atol=3e-5)
    np.testing.assert_allclose(sampled.drift, 0.0, atol=1e-8)


def test_error_of_the_linear_form_falls_with_the_square_of_the_inputs(plant, found):
    linear = linearise(plant, found.x, found.u)
    shapes = jnp.asarray(np.random.default_rng(5).choice([-1.0, 1.0], (10, 3)))
    large, small = (linearisation_error(plant, linear, found.u + size * shapes) for size in (0.02, 0.01))
    assert float(jnp.max(small)) > 1e-9
    np.testing.assert_allclose(float(jnp.max(large)) / float(jnp.max(small)), 4.0, rtol=0.1)


def test_what_has_no_trim_or_no_rates_is_refused(plant):
    with pytest.raises(InputError, match=r"^trim: NPS AUV II: has 3 inputs for 4 conditions .*; hold 1 fewer"):
        trim(plant, {"u": 1.5, "phi": 0.0, "depth_rate": 0.0, "heading_rate": 0.0})
    with pytest.raises(InputError, match=r"^trim: wanted 'heading': .*did you mean 'heading_rate'\?$"):
        trim(plant, {"heading": 0.0})
    with pytest.raises(InputError, match=r"^NPS AUV II: has no trim as wanted: .* is left"):
        rudderless = plant.with_values({"N_delta_r": jnp.zeros(()), "Y_delta_r": jnp.zeros(())})
        require_trim(rudderless, trim(rudderless))
    lagging = discretise(concealing(), DT)
    with pytest.raises(InputError, match=r"keeps samples \(rudder_held_0\); linearise its step instead$"):
        linearise_rates(lagging, jnp.zeros(len(lagging.states)), jnp.zeros(3))


def test_mechanism_is_held_where_it_is_wanted():
    rig = discretise(coupled(), DT)
    held = require_trim(rig, trim(rig, {"a": 0.3}))
    # K q = B u + F with K = [[3, -1], [-1, 5]], B = [1, 0], F = [0, 0.2]
    b = (0.2 + 0.3) / 5.0
    np.testing.assert_allclose(held.x, [0.0, 0.0, 0.3, b], atol=1e-9)
    assert float(held.u[0]) == pytest.approx(3.0 * 0.3 - b, abs=1e-9)
