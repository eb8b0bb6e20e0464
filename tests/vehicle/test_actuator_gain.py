"""A gain scales all that a vehicle has of one actuator: by hand, in the file, and only where nothing free does so."""

import dataclasses
import tomllib

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from rigs import driven, oscillator, stacked

from jaxsub.discrepancy import diagnose
from jaxsub.effects import (
    ActuatorBacklash,
    ActuatorGain,
    QuadraticDamping,
    SensorScale,
    vocabulary,
)
from jaxsub.errors import InputError
from jaxsub.simulation import at_rest, simulate, synthetic
from jaxsub.vehicle import added_effects, vehicle_findings, vehicle_from, vehicle_text, with_coefficients

PLACE, AHEAD, ACROSS = [-0.2, 0.15, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]
THRUSTER = {"kind": "thruster", "position": PLACE, "direction": AHEAD, "forward": 0.8, "reverse": 0.6, "dead_band": 0.2}
FIN = {"kind": "fin", "position": PLACE, "direction": ACROSS, "area": 0.02, "lift_slope": 3.0, "drag": 0.9}
SCREW = {"kind": "propeller", "position": PLACE, "diameter": 0.2, "K_T": [0.3, -0.2], "K_Q": [0.03]}
RUDDER = {"kind": "rudder", "position": [-1.0, 0.0, 0.1], "area": 0.02, "aspect_ratio": 1.5, "a_H": 0.3, "epsilon": 1.1}
# one of each kind that has a force of its own
DEVICES = {
    "thruster": THRUSTER,
    "advancing thruster": THRUSTER | {"advance": 0.3},
    "fin": FIN,
    "fin by derivative": {k: v for k, v in FIN.items() if k in ("kind", "position", "direction")} | {"derivative": 9.0},
    "propeller": SCREW,
    "rudder": RUDDER,
    "tank": {"kind": "ballast", "position": PLACE, "of": "mass"},
    "moving mass": {"kind": "moving-mass", "direction": AHEAD, "mass": 9.0},
}
FREE = {"value": 1.0, "free": True}
FIXED = {"value": 2.0, "fixed": True}


def body(actuators, coefficients=None, inputs=None, **changes):
    tree = {
        "schema": 1, "name": "body", "kind": "submerged-body",
        "body": {"mass": 20.0, "inertia": [0.5, 0.8, 0.9]}, "coefficients": {"X_u": -12.0} | (coefficients or {}),
        "inputs": inputs or {name: name for name in actuators}, "actuators": actuators,
        "outputs": {c: {"sigma": 0.005} for c in "uvwpqr"},
    }  # fmt: skip
    return vehicle_from(tree | changes, "body.toml")


def at(vehicle, seed=3, count=6):
    """States and signals, random: (count, s) and (count, m)."""
    draws, layout = np.random.default_rng(seed), vehicle.layout
    states = jnp.asarray(draws.normal(size=(count, len(layout.states))) * 0.4)
    return states, jnp.asarray(draws.normal(size=(count, len(layout.inputs))))


def added(vehicle, effect):
    """What the effect adds to the force on each equation, (count, 6)."""
    motion = vehicle.motion(*at(vehicle))
    return np.asarray(vehicle.with_effect(effect).force(motion) - vehicle.force(motion))


def test_weak_thruster_loses_that_part_of_its_thrust_by_hand():
    """Claim: dead band, curve and lever arm of one of two thrusters, times g, in NumPy; nothing of the other."""
    vehicle = body({"port": THRUSTER, "starboard": THRUSTER | {"position": [0.3, -0.4, 0.1]}})
    found = added(vehicle, ActuatorGain("port", jnp.asarray(-0.2)))
    for row, (command, _) in zip(found, np.asarray(at(vehicle)[1]), strict=True):
        left = np.sign(command) * max(abs(command) - 0.2, 0.0)
        thrust = (0.8 if command > 0 else 0.6) * abs(left) * left
        force = -0.2 * thrust * np.array(AHEAD)
        np.testing.assert_allclose(row, [*force, *np.cross(PLACE, force)], atol=1e-13)


def test_gain_of_an_input_is_of_every_coefficient_by_it():
    """Claim: by hand of products, of a thrust that pushes as it is, and of one of two elevators, whose mean acts."""
    inputs = {n: n for n in ("rudder", "shaft_speed", "thrust", "elevator_right", "elevator_left")}
    numbers = {"Y_delta_r": 2.0, "N_uu_delta_r": -3.0, "X_nn": 0.5, "K_T": 0.1, "M_delta_e": 4.0, "Z_delta_er": -5.0}
    vehicle = body({}, numbers, inputs)
    (states, signals), g = at(vehicle), jnp.asarray(0.3)
    u, (r, n, T, right, _) = np.asarray(states)[:, 0], np.asarray(signals).T
    zero = np.zeros_like(u)
    expected = {
        "rudder": [zero, 2.0 * r, zero, zero, zero, -3.0 * u * u * r],
        "shaft_speed": [0.5 * abs(n) * n, zero, zero, zero, zero, zero],
        "thrust": [T, zero, zero, 0.1 * T, zero, zero],
        "elevator_right": [zero, zero, -5.0 * right, zero, 4.0 * right / 2.0, zero],
    }
    for name, hand in expected.items():
        np.testing.assert_allclose(added(vehicle, ActuatorGain(name, g)), 0.3 * np.stack(hand, 1), atol=1e-12)


def test_gain_of_a_mechanism_s_drive():
    rig = oscillator()
    np.testing.assert_allclose(
        added(rig, ActuatorGain("drive", jnp.asarray(-0.3)))[:, 0], -0.6 * np.asarray(at(rig)[1])[:, 0], atol=1e-14
    )


@pytest.mark.parametrize("device", DEVICES)
def test_factor_of_every_kind_of_actuator_scales_its_whole_force(device):
    """Claim: the effect and that number, set or written and read back, are one thing; no factor, no number."""
    plain = body({"a": DEVICES[device]})
    effect = ActuatorGain("a", jnp.asarray(-0.3))
    vehicle, (item,) = plain.with_effect(effect), plain.actuators.items
    assert np.abs(added(plain, effect)).max() > 1e-3
    written = with_coefficients(vehicle)
    again = vehicle_from(tomllib.loads(vehicle_text(written)), "again.toml")
    rates = [one.acceleration(*at(one)) for one in (vehicle, written, again)]
    np.testing.assert_allclose(rates[1], rates[0], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(rates[2], rates[0], rtol=1e-12, atol=1e-12)
    if device == "advancing thruster":
        assert written is vehicle and not item.factor
        return
    assert written.effects == ()
    base = float(item.value(item.factor, 1.0))
    row = next(row for row in again.layout.free if row.name == f"a.{item.factor}")
    assert (row.prior_mean, row.prior_std) == (pytest.approx(base), pytest.approx(0.2 * base))
    assert float(again.values()[row.name]) == pytest.approx(0.7 * base)
    assert again.fixed_gains == ()
    (found,) = added_effects(again, plain, vocabulary())
    assert found.label == "actuator-gain[a]" and float(found.gain) == pytest.approx(-0.3)


def test_what_another_actuator_or_number_follows_stays_an_effect():
    """Claim: a propeller in front of a rudder, a tied gain and an input's coefficients are written as `[[effects]]`."""
    raced = body({"a": SCREW, "tail": RUDDER | {"propeller": "a"}})
    tied = body({"a": THRUSTER | {"gain": "b.gain"}, "b": THRUSTER | {"gain": 0.9}})
    input_only = body({}, {"N_delta_r": FIXED}, {"rudder": "a"})
    for plain, name in ((raced, "a"), (tied, "a"), (input_only, "rudder")):
        vehicle = plain.with_effect(ActuatorGain(name, jnp.asarray(-0.3)))
        assert with_coefficients(vehicle) is vehicle
        again = vehicle_from(tomllib.loads(vehicle_text(vehicle)), "again.toml")
        assert [effect.label for effect in again.effects] == [f"actuator-gain[{name}]"]
        assert vehicle_text(again) == vehicle_text(vehicle)


def test_force_has_the_slope_of_its_difference_quotient():
    """Claim: of a simulated run the derivative by g is the difference quotient."""
    vehicle = body({"port": THRUSTER, "tail": FIN}).with_effect(ActuatorGain("tail", jnp.asarray(-0.1)))
    runs = stacked(vehicle, [driven(vehicle, 0.1 * np.arange(40), seed=1, amplitude=0.4)])
    start = at_rest(vehicle, 1).at[0, 0].set(1.0)
    moved = jax.jit(lambda g: simulate(vehicle.with_values({"actuator-gain[tail].g": g}), runs, start))
    slope = jax.jvp(moved, (jnp.asarray(-0.1),), (jnp.asarray(1.0),))[1]
    quotient = (moved(-0.1 + 1e-5) - moved(-0.1 - 1e-5)) / 2e-5
    assert np.abs(quotient).max() > 1e-2
    np.testing.assert_allclose(slope, quotient, atol=1e-7)


@pytest.mark.parametrize(
    ("actuators", "coefficients", "inputs", "expected"),
    [
        ({"a": THRUSTER, "b": THRUSTER | {"gain": FREE}}, {}, None, "a"),
        ({"a": THRUSTER | {"gain": "b.gain"}, "b": THRUSTER | {"gain": FREE}}, {}, None, "a"),
        ({"a": THRUSTER | {"direction": [0.0, 0.0, 1.0], "position": [0.0, 0.0, 1.0]}}, {}, None, ""),
        ({"a": {"kind": "generic"}}, {"B_yaw_a": FIXED}, None, "a"),
        ({}, {"Y_delta_r": 1.0, "N_delta_r": 2.0}, {"rudder": "r"}, ""),
        ({}, {"Y_delta_r": 1.0, "N_delta_r": FIXED}, {"rudder": "r"}, "rudder"),
        ({}, {"Y_delta_r": 1.0, "K_delta_r": FIXED}, {"rudder": "r"}, ""),
        ({}, {}, {"thrust": "T"}, "thrust"),
        ({}, {"X_T": 1.0}, {"thrust": "T"}, ""),
        ({}, {"N_T": 1.0}, {"thrust": "T"}, "thrust"),
        ({}, {"N_delta_e": 1.0}, {"elevator_left": "l", "elevator_right": "r"}, "elevator_left elevator_right"),
    ],
)
def test_candidate_where_no_free_number_scales_the_force(actuators, coefficients, inputs, expected):
    """Claim: not where the gain is free, all coefficients are, or no free equation feels it; else the actuators."""
    vehicle = body(actuators, coefficients, inputs, dof=["surge", "sway", "yaw"])
    assert sorted(vehicle.fixed_gains) == expected.split()


@pytest.mark.parametrize("plain", [oscillator(), body({}, {"Y_delta_r": 1.0, "N_delta_r": 2.0}, {"rudder": "r"})])
def test_vehicle_with_free_coefficients_is_offered_none(plain):
    assert plain.fixed_gains == ()


def test_effect_on_no_actuator_is_refused():
    tree = tomllib.loads(vehicle_text(body({"port": THRUSTER})))
    tree["effects"] = [{"effect": "actuator-gain", "actuator": "prt", "parameters": {"g": -0.2}}]
    with pytest.raises(InputError, match=r"effects\[1\] \(actuator-gain\): prt: unknown key; did you mean port"):
        vehicle_from(tree, "body.toml")


def test_effect_beside_a_free_gain_is_reported():
    """Claim: said twice where the gain is free, and not where it is fixed."""
    for gain, expected in ((FREE, ["body.toml: effects (actuator-gain[port])"]), (FIXED, [])):
        vehicle = body({"port": THRUSTER | {"gain": gain}}).with_effect(ActuatorGain("port", jnp.asarray(-0.2)))
        assert [one.where for one in vehicle_findings(vehicle, "body.toml") if one.check == "said-twice"] == expected


VOCABULARY = (ActuatorGain, ActuatorBacklash, QuadraticDamping, SensorScale)


def cart(**drive):
    """A coordinate with a drive of known strength."""
    values = {"D_x": 0.6, "K_x": 4.0, "B_x_drive": {"value": 2.0, "fixed": True} | drive}
    return oscillator(coefficients=values)


def recordings(truth, seed):
    """Runs of growing commands: by one level alone a lost share and a dead band are the same."""
    runs = [driven(truth, 0.1 * np.arange(200), seed + i, amplitude=1.0) for i in range(3)]
    grown = [run.columns | {"f": run.columns["f"] * np.linspace(0.2, 1.5, 200)} for run in runs]
    return synthetic(truth, [dataclasses.replace(r, columns=c) for r, c in zip(runs, grown, strict=True)], seed=seed)


@pytest.mark.long
def test_weak_drive_is_named_as_such():
    """Claim: a fifth less force than the file's, within three errors, beside play, drag and scales."""
    runs = recordings(cart(value=1.6), 1)
    found, _ = diagnose(cart(), runs[:2], runs[2:], vocabulary=VOCABULARY)
    assert (found.verdict, [one.label for one in found.physics]) == ("named", ["actuator-gain[drive]"])
    size = found.physics[0].parameters["g"]
    assert abs(size.value + 0.2) < 3.0 * size.standard_error < 0.05
    assert found.where[0].where == "input:drive"


@pytest.mark.long
@pytest.mark.parametrize("seed", [1, 2])
def test_drive_as_strong_as_the_file_says_is_no_finding(seed):
    runs = recordings(cart(), seed)
    found, _ = diagnose(cart(), runs[:2], runs[2:], vocabulary=VOCABULARY)
    assert (found.verdict, found.physics) == ("none", [])
