"""An effect that is one derivative and the coefficient of that derivative are one thing, in two places of a file."""

import dataclasses
import tomllib

import jax.numpy as jnp
import numpy as np
import pytest
from rigs import _facts, body, coupled

from jaxsub.effects import (
    AbstractDerivative,
    CoriolisCoupling,
    CubicDamping,
    QuadraticDamping,
    SpeedScaling,
    ThrusterCrossCoupling,
    candidates,
    vocabulary,
    with_numbers,
)
from jaxsub.vehicle import added_effects, vehicle_from, vehicle_text, with_coefficients

BODY = vehicle_from(
    {
        "schema": 1, "name": "shaft", "kind": "submerged-body",
        "body": {"mass": 60.0, "inertia": [1.0, 12.0, 12.0], "speed": 1.5}, "coefficients": {"Y_v": -80.0},
        "inputs": {"shaft_speed": "n", "elevator_left": "el", "elevator_right": "er", "rudder": "dr"},
        "outputs": {"v": {"sigma": 0.01}},
    },
    "shaft.toml",
)  # fmt: skip
SINGLE = [e for e in (*candidates(_facts(BODY)), *candidates(_facts(body()))) if isinstance(e, AbstractDerivative)]


def acceleration(vehicle):
    draws, layout = np.random.default_rng(1), vehicle.layout
    states = jnp.asarray(draws.normal(size=(4, len(layout.states))))
    return np.asarray(vehicle.acceleration(states, jnp.asarray(draws.normal(size=(4, len(layout.inputs))))))


def having(effect):
    """A vehicle that can have the effect, with it."""
    needed = {variable for variable in effect.derivative.variables if variable in ("elevator", "thrust")}
    plain = dataclasses.replace(body(), layout=dataclasses.replace(body().layout, environment=()))
    vehicle = plain if needed else BODY
    (field,) = effect.symbols()
    return vehicle, vehicle.with_effect(with_numbers(effect, {field: -1.7}))


@pytest.mark.parametrize("effect", SINGLE, ids=lambda effect: effect.label)
def test_effect_of_one_derivative_is_written_as_a_coefficient_and_moves_the_vehicle_the_same(effect):
    """Claim: for every such form of the vocabulary the coefficient gives the same accelerations, read back too."""
    plain, vehicle = having(effect)
    written = with_coefficients(vehicle)
    if effect.derivative.name in plain.has:
        assert written is vehicle
        return
    assert written.effects == ()
    again = vehicle_from(tomllib.loads(vehicle_text(written)), "improved.toml")
    assert effect.derivative.name in tomllib.loads(vehicle_text(written))["coefficients"]
    row = next(row for row in again.layout.free if row.name == effect.derivative.name)
    assert row.unit == effect.derivative.unit
    np.testing.assert_allclose(acceleration(again), acceleration(vehicle), rtol=1e-12, atol=1e-12)
    assert np.abs(acceleration(again) - acceleration(plain)).max() > 1e-3


@pytest.mark.parametrize("effect", SINGLE, ids=lambda effect: effect.label)
def test_vehicle_with_the_coefficient_is_not_offered_the_effect(effect):
    """Claim: the effect is a candidate of the plain vehicle and none of the one with its coefficient; others stay."""
    _, vehicle = having(effect)
    written = with_coefficients(vehicle)
    before = [one.label for one in candidates(_facts(vehicle))]
    after = [one.label for one in candidates(dataclasses.replace(_facts(vehicle), has=written.has))]
    assert effect.label in before
    assert effect.label not in after
    assert set(before) - set(after) < {one.label for one in SINGLE} | {"speed-scaling[roll,roll]"}


def test_quadratic_damping_of_roll_is_written_as_its_symbol():
    text = vehicle_text(with_coefficients(BODY.with_effect(QuadraticDamping("roll", jnp.asarray(-0.5)))))
    assert '"K_p|p|" = {value = -0.5}' in text
    assert "effects" not in tomllib.loads(text)


def test_port_elevator_keeps_its_direction():
    """Claim: `K_delta_el` enters with a minus, so the coefficient has the opposite sign of the effect's number."""
    vehicle = BODY.with_effect(ThrusterCrossCoupling("roll", "elevator_left", jnp.asarray(2.0)))
    written = with_coefficients(vehicle)
    assert float(written.values()["K_delta_el"]) == -2.0
    np.testing.assert_allclose(acceleration(written), acceleration(vehicle), rtol=1e-12)


def test_what_is_no_single_derivative_stays_an_effect():
    """Claim: products about a speed and of fractions, and all effects of a mechanism, are written as before."""
    scaling = BODY.with_effect(SpeedScaling("yaw", "yaw", jnp.asarray(-1.0)))
    coupling = BODY.with_effect(CoriolisCoupling(BODY.layout.equations, jnp.asarray(1.0)))
    rig = coupled().with_effect(CubicDamping("a", jnp.asarray(-1.0)))
    for vehicle in (scaling, coupling, rig):
        assert with_coefficients(vehicle) is vehicle


def test_products_about_a_speed_are_not_offered_where_the_product_is_there():
    tree = tomllib.loads(vehicle_text(BODY))
    tree["coefficients"]["N_ur"] = -1.0
    tree["model"] = {"coriolis": "full"}
    vehicle = vehicle_from(tree, "nonlinear.toml")
    labels = [one.label for one in candidates(dataclasses.replace(_facts(vehicle), has=vehicle.has))]
    assert "speed-scaling[yaw,yaw]" not in labels
    assert "speed-scaling[sway,sway]" in labels
    assert not [label for label in labels if label.startswith("coriolis-coupling")]


def test_improved_file_is_gone_on_from_with_the_effects_that_it_came_from():
    """Claim: of an improved vehicle the added coefficients come back as the effects, with their numbers."""
    effects = [QuadraticDamping("roll", jnp.asarray(-0.5)), SpeedScaling("yaw", "yaw", jnp.asarray(-1.0))]
    vehicle = BODY
    for effect in effects:
        vehicle = vehicle.with_effect(effect)
    improved = vehicle_from(tomllib.loads(vehicle_text(with_coefficients(vehicle))), "improved.toml")
    found = {one.label: one for one in added_effects(improved, BODY, vocabulary())}
    assert set(found) == {effect.label for effect in effects}
    assert float(found["quadratic-damping[roll]"].coefficient) == -0.5
