"""The plant is the simulation taken one sample at a time, with whatever actuators and sensors remember in its state."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from control_cases import concealing, remembering
from rigs import coupled, driven

from jaxsub.control import discretise
from jaxsub.effects import AbstractActuator
from jaxsub.effects.actuators import ActuatorDelay
from jaxsub.errors import InputError
from jaxsub.parameters import number
from jaxsub.recording import Recording
from jaxsub.simulation import at_rest, sampled_states, synthetic
from jaxsub.vehicle import read_vehicle, vehicle_from, write_vehicle
from jaxsub.vehicle.catalogue import nps_auv_ii, remus_100

DT = 0.25
TIMES = DT * np.arange(17)


def plant_answer(plant, run, start):
    """Outputs of a plant driven by the inputs of a recording."""
    inputs = jnp.asarray(np.stack([run.column(c) for c in plant.vehicle.layout.held], axis=1))

    @jax.jit
    def answer(inputs):
        states = plant.run(plant.start(start, inputs[0]), inputs[:-1])
        return jax.vmap(plant.output)(states, inputs, jnp.asarray(run.times))

    return np.asarray(answer(inputs))


@pytest.mark.parametrize("make", [remus_100, coupled, remembering])
def test_plant_stepped_is_the_simulation(make):
    vehicle = make()
    start = at_rest(vehicle, 1)
    (run,) = synthetic(vehicle, [driven(vehicle, TIMES, 3, hold=3)], seed=1, noise=False, states=sampled_states)
    shown = plant_answer(discretise(vehicle, DT), run, start[0])
    for name, samples in zip(vehicle.layout.channels, shown.T, strict=True):
        np.testing.assert_allclose(samples, run.column(name), rtol=1e-9, atol=1e-10, err_msg=name)


def test_improved_vehicle_read_from_its_file_is_the_same_plant(tmp_path):
    vehicle = remembering()
    write_vehicle(vehicle, tmp_path / "improved.toml", "with what a diagnosis added")
    read = discretise(read_vehicle(tmp_path / "improved.toml"), DT)
    plant = discretise(vehicle, DT)
    assert read.states == plant.states
    x = jnp.linspace(0.01, 0.2, len(plant.states)).at[0].set(1.8)
    step = eqx.filter_jit(lambda plant: plant.step(x, jnp.full(3, 0.1)))
    np.testing.assert_allclose(step(read), step(plant), rtol=1e-12)


@pytest.mark.parametrize("make", [concealing, coupled])
def test_jacobians_are_those_of_finite_differences(make):
    plant = discretise(make(), DT)
    s, m = len(plant.states), len(plant.inputs)
    rng = np.random.default_rng(4)
    point = jnp.asarray(0.1 * rng.standard_normal(s + m)).at[0].add(1.5)
    both = jax.jit(lambda w: jnp.concatenate([plant.step(w[:s], w[s:]), plant.output(w[:s], w[s:])]))
    h = 1e-5
    by_hand = np.stack([(both(point + h * e) - both(point - h * e)) / (2 * h) for e in np.eye(s + m)], axis=1)
    A, B, C, D = jax.jit(lambda w: plant.jacobians(w[:s], w[s:]))(point)
    np.testing.assert_allclose(np.block([[A, B], [C, D]]), by_hand, atol=2e-8)


def test_derivatives_by_the_vehicles_numbers_are_those_of_finite_differences():
    plant = discretise(concealing(), DT)
    x = plant.start(at_rest(plant.vehicle, 1)[0], jnp.zeros(3))
    inputs = jnp.full((12, 3), 0.1)
    names = ("N_r", "Y_v", "mass", "actuator-lag[rudder].T")
    values = {name: plant.vehicle.values()[name] for name in names}
    last = jax.jit(lambda values: plant.with_values(values).run(x, inputs)[-1])
    by = jax.jit(jax.jacfwd(last))(values)
    for name in names:
        h = 1e-6 * jnp.abs(values[name])
        moved = lambda side, name=name, h=h: last(values | {name: values[name] + side * h})
        np.testing.assert_allclose(by[name] * h, (moved(1.0) - moved(-1.0)) / 2.0, atol=1e-11, err_msg=name)


def test_plants_of_many_vehicles_step_at_once():
    plant = discretise(concealing(), DT)
    x, u = plant.start(at_rest(plant.vehicle, 1)[0], jnp.zeros(3)), jnp.full(3, 0.1)
    slopes = jnp.linspace(-12000.0, -8000.0, 5)
    step = jax.jit(lambda slope: plant.with_values({"N_r": slope}).run(x, jnp.tile(u, (4, 1)))[-1])
    together = jax.vmap(step)(slopes)
    for slope, answer in zip(slopes, together, strict=True):
        np.testing.assert_allclose(answer, step(slope), rtol=1e-10, atol=1e-13)


def test_column_that_nobody_moves_is_a_constant():
    data = {
        "schema": 1, "name": "float", "kind": "submerged-body", "dof": ["heave"],
        "body": {"mass": 100.0, "weight": 981.0, "buoyancy": 981.0},
        "coefficients": {"Z_w": -50.0}, "environment": {"density": "rho"}, "outputs": {"w": {"sigma": 0.01}},
    }  # fmt: skip
    vehicle = vehicle_from(data, "float.toml")
    plant = discretise(vehicle, DT, {"rho": 1030.0})
    assert plant.inputs == ()
    run = Recording("run", TIMES, {"rho": np.full(len(TIMES), 1030.0)}, "run")
    (answer,) = synthetic(vehicle, [run], seed=1, noise=False, states=sampled_states)
    states = plant.run(plant.start(at_rest(vehicle, 1)[0], jnp.zeros(0)), jnp.zeros((len(TIMES) - 1, 0)))
    np.testing.assert_allclose(states[:, 0], answer.column("w"), atol=1e-12)
    with pytest.raises(InputError, match=r"^float: column 'rho': is no input of a plant; give 'rho' a constant$"):
        discretise(vehicle, DT)


class Sluggish(AbstractActuator):
    """Answers to the sample before."""

    actuator: str = "rudder"
    name = "sluggish"
    family = "actuators"

    @classmethod
    def candidates(cls, facts):
        return []

    expression = property(lambda self: "late")

    def respond(self, times, nodes):
        return jnp.concatenate([nodes[:1], nodes[:-1]])


@pytest.mark.parametrize(
    ("make", "what"),
    [
        (lambda: discretise(nps_auv_ii(), 0.0), r"^NPS AUV II: dt: 0 s is not positive"),
        (lambda: discretise(nps_auv_ii(), DT, {"delta": 0.0}), r"^given column 'delta': .*did you mean 'delta_"),
        (lambda: discretise(nps_auv_ii().with_effect(Sluggish()), DT), r"^sluggish.*: does not say how it goes on"),
    ],
)
def test_plant_that_cannot_be_made_is_refused(make, what):
    with pytest.raises(InputError, match=what):
        make()


def test_delay_keeps_its_room_when_its_length_is_traced():
    plant = discretise(nps_auv_ii().with_effect(ActuatorDelay("rudder", number(0.6))), DT)
    x = plant.start(at_rest(plant.vehicle, 1)[0], jnp.zeros(3))
    assert plant.states[-3:] == ("rudder_held_0", "rudder_held_1", "rudder_held_2")
    yaw = lambda tau: plant.with_values({"actuator-delay[rudder].tau": tau}).run(x, jnp.full((8, 3), 0.1))[-1, 5]
    low, high = jax.jit(jax.vmap(yaw))(jnp.array([0.599, 0.601]))
    assert float(jax.jit(jax.jacfwd(yaw))(jnp.asarray(0.6))) == pytest.approx(float(high - low) / 0.002, rel=1e-4)
