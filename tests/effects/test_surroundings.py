"""Forces of the surroundings, of events and of the propeller are the formulas of their books, worked out in NumPy."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from samples import BODY, RIG, facts, motion
from scipy.spatial.transform import Rotation

from jaxsub.effects import (
    EQUATIONS,
    BottomSuction,
    Current,
    FreeSurfaceSuction,
    MassShift,
    PropellerAsymmetry,
    PropellerRace,
    TetherDrag,
    ThrusterCrossCoupling,
    ThrustLoss,
    TurningSpeedLoss,
    WaveForcing,
    admissible,
    looked_at,
    wave_band,
)
from jaxsub.vehicle import catalogue

NOW = motion(BODY, count=60)
RATES = {e: np.asarray(NOW.rates[e]) for e in EQUATIONS}
one = jnp.asarray


def attitude():
    """Rotation from the body to north, east, down."""
    angles = np.stack([NOW.positions[name] for name in ("psi", "theta", "phi")], -1)
    return Rotation.from_euler("ZYX", angles)


def test_current_flows_in_the_axes_of_the_body():
    found = Current(EQUATIONS, one(0.4), one(-0.3)).water(NOW.positions)
    expected = attitude().inv().apply([0.4, -0.3, 0.0])
    np.testing.assert_allclose(np.stack(found, 1), expected, rtol=1e-10, atol=1e-12)


def test_wave_is_a_sine_of_the_runs_time():
    found = WaveForcing("pitch", one(2.0), one(-1.0), one(0.7)).force(NOW)["pitch"]
    t = np.linspace(0.0, 60.0, 60)
    np.testing.assert_allclose(found, np.sqrt(5.0) * np.cos(0.7 * t + np.arctan2(1.0, 2.0)), rtol=1e-11, atol=1e-11)


def test_wave_frequencies_are_those_that_stand_out_and_all_that_were_looked_at_count():
    """Claim: a candidate for each tone of each equation; a rig has none; every frequency in every equation counts."""
    found = [(e.equation, float(e.omega)) for e in WaveForcing.candidates(BODY)]
    assert found == [(equation, omega) for equation in EQUATIONS for omega in (0.9, 2.1)]
    assert WaveForcing.candidates(RIG) == []
    assert looked_at(BODY) == {"wave-forcing": 6 * 150}


@pytest.mark.parametrize(("duration", "longest"), [(20.0, 10.0), (600.0, 30.0)])
def test_wave_band_is_what_record_and_samples_resolve_and_the_sea_has(duration, longest):
    """Claim: from two periods in a run, and half a minute at most, to four samples in a period."""
    slow, fast = wave_band(duration, 0.2)
    assert 2.0 * np.pi / slow == pytest.approx(longest)
    assert 2.0 * np.pi / fast == pytest.approx(0.8)


def test_suction_pulls_towards_its_boundary_and_dies_out():
    """Claim: heave and pitch go as the squared speed and die out over one reach; heave is towards the boundary only."""
    depth, above = np.maximum(NOW.positions["z"], 0.0), np.asarray(NOW.environment["altitude"])
    up = FreeSurfaceSuction(one(-3.0), one(0.7), one(0.5)).force(NOW)
    np.testing.assert_allclose(up["heave"], -3.0 * RATES["surge"] ** 2 * np.exp(-2.0 * depth), rtol=1e-12)
    np.testing.assert_allclose(up["pitch"], 0.7 * RATES["surge"] ** 2 * np.exp(-2.0 * depth), rtol=1e-12)
    down = BottomSuction(one(3.0), one(-0.7), one(0.5)).force(NOW)
    np.testing.assert_allclose(down["heave"], 3.0 * RATES["surge"] ** 2 * np.exp(-2.0 * above), rtol=1e-12)
    np.testing.assert_allclose(down["pitch"], -0.7 * RATES["surge"] ** 2 * np.exp(-2.0 * above), rtol=1e-12)
    allowed = lambda effect, heave, pitch: admissible(effect, {"heave": heave, "pitch": pitch, "h": 1.0})
    for pitch in (-1.0, 1.0):
        assert allowed(FreeSurfaceSuction(), -1.0, pitch)
        assert not allowed(FreeSurfaceSuction(), 1.0, pitch)
        assert allowed(BottomSuction(), 1.0, pitch)
        assert not allowed(BottomSuction(), -1.0, pitch)


def test_boundaries_that_the_record_does_not_hold_have_no_candidates():
    blind = dataclasses.replace(BODY, environment=(), channels=("u", "r"))
    assert [kind.candidates(blind) for kind in (BottomSuction, FreeSurfaceSuction, TetherDrag)] == [[], [], []]
    deep = dataclasses.replace(BODY, depth_range=(30.0, 40.0))
    assert FreeSurfaceSuction.candidates(deep) == []


def test_tether_drag_is_against_the_velocity_and_takes_power():
    found = TetherDrag(EQUATIONS[:3], one(0.8)).force(NOW)
    velocity = np.stack([RATES[e] for e in EQUATIONS[:3]], 1)
    size = 0.8 * np.maximum(NOW.positions["z"], 0.0) * np.linalg.norm(velocity, axis=1)
    np.testing.assert_allclose(np.stack([found[e] for e in EQUATIONS[:3]], 1), -size[:, None] * velocity, rtol=1e-9)
    assert np.sum(np.stack([found[e] for e in EQUATIONS[:3]], 1) * velocity, 1).max() <= 0.0


@pytest.mark.parametrize(("axis", "arm"), [("x", [0.02, 0.0, 0.0]), ("y", [0.0, 0.02, 0.0])])
def test_a_shifted_mass_has_the_moment_of_its_weight_from_its_time_on(axis, arm):
    found = MassShift(axis, 0.1, one(0.02), one(20.0)).force(NOW)
    weight = attitude().inv().apply([0.0, 0.0, 500.0])
    moment = np.cross(np.broadcast_to(arm, weight.shape), weight)
    t = np.linspace(0.0, 60.0, 60)
    for equation, column in (("roll", 0), ("pitch", 1), ("yaw", 2)):
        part = np.broadcast_to(found.get(equation, 0.0), 60)
        np.testing.assert_allclose(part[t > 21.0], moment[t > 21.0, column], rtol=1e-6, atol=1e-9)
        np.testing.assert_allclose(part[t < 19.0], 0.0, atol=1e-6)


@pytest.mark.parametrize("by", ["shaft_speed", "thrust", "constant"])
def test_lost_thrust_is_a_share_of_what_was_there_from_its_time_on(by):
    now = motion(facts(actuators=("rudder", "shaft_speed", "thrust")), count=60)
    found = ThrustLoss(by, 0.1, one(0.3), one(20.0)).force(now)["surge"]
    n = np.asarray(now.actuators["shaft_speed"])
    pushed = {"shaft_speed": np.sign(n) * n**2, "thrust": np.asarray(now.actuators["thrust"]), "constant": np.ones(60)}
    t = np.linspace(0.0, 60.0, 60)
    np.testing.assert_allclose(found[t > 21.0], -0.3 * pushed[by][t > 21.0], rtol=1e-6)
    np.testing.assert_allclose(found[t < 19.0], 0.0, atol=1e-6)


def test_an_event_moves_its_impulse_with_its_time():
    """The derivative in t₀, summed over the samples, is the whole step: none of it falls between samples."""
    times = jnp.linspace(0.0, 60.0, 601)
    now = motion(BODY, count=601)
    now = dataclasses.replace(now, time=times)
    loss = lambda t_0: ThrustLoss("constant", 0.1, one(2.0), t_0).force(now)["surge"]
    for t_0 in (20.0, 20.03, 20.05):
        slope = jax.jvp(loss, (one(t_0),), (one(1.0),))[1]
        np.testing.assert_allclose(0.1 * slope.sum(), 2.0, rtol=5e-3)


@pytest.mark.parametrize("by", ["shaft_speed", "thrust"])
def test_propeller_and_fin_forces_grow_with_thrust(by):
    now = motion(facts(actuators=("rudder", by)), count=60)
    drive = np.asarray(now.actuators[by])
    pushed = drive if by == "thrust" else np.sign(drive) * drive**2
    rudder = np.asarray(now.actuators["rudder"])
    np.testing.assert_allclose(PropellerAsymmetry("yaw", by, one(0.2)).force(now)["yaw"], 0.2 * pushed, rtol=1e-12)
    raced = PropellerRace("sway", "rudder", by, one(0.2)).force(now)["sway"]
    np.testing.assert_allclose(raced, 0.2 * rudder * pushed, rtol=1e-12)
    crossed = ThrusterCrossCoupling("roll", "rudder", one(-0.4)).force(now)["roll"]
    np.testing.assert_allclose(crossed, -0.4 * rudder, rtol=1e-14)


def test_candidates_of_the_propeller_need_its_recording():
    silent = facts(actuators=("rudder", "elevator"))
    assert [kind.candidates(silent) for kind in (PropellerRace, PropellerAsymmetry)] == [[], []]
    assert {(e.equation, e.fin) for e in PropellerRace.candidates(BODY)} == {
        ("sway", "rudder"), ("yaw", "rudder"), ("heave", "elevator"), ("pitch", "elevator")
    }  # fmt: skip
    assert {e.of for e in ThrustLoss.candidates(silent)} == {"constant"}
    assert ThrustLoss.candidates(RIG) == []


@pytest.mark.parametrize(
    ("name", "of"),
    [
        ("bluerov2_heavy", {"constant"}),  # four vectored thrusters by names of their own, at no speed
        ("seaglider", set()),  # ballast alone
        ("nps_auv_ii", {"constant"}),  # at a speed, of a propulsion that is not recorded
        ("kvlcc2", {"shaft_speed"}),
    ],
)
def test_thrust_is_lost_by_what_an_actuator_pushes_or_what_operates_at_a_speed(name, of):
    """Claim: thrust loss is offered to published vehicles whose thrusters or speed say that they are driven."""
    vehicle = getattr(catalogue, name)()
    actuators = tuple(name for name, _ in vehicle.layout.inputs)
    known = facts(equations=vehicle.layout.equations, actuators=actuators)
    known = dataclasses.replace(known, has=vehicle.has, speed=vehicle.speed)
    assert {effect.of for effect in ThrustLoss.candidates(known)} == of


def test_turning_loses_speed_by_every_product_of_the_textbook_and_no_square_propels():
    found = {e.symbols()["coefficient"]: e for e in TurningSpeedLoss.candidates(BODY)}
    assert {"X_vv", "X_vr", "X_rr", "X_rudder_rudder", "X_ww", "X_wq", "X_qq", "X_elevator_elevator"} == set(found)
    for symbol, effect in found.items():
        assert admissible(effect, {"coefficient": -1.0})
        assert admissible(effect, {"coefficient": 1.0}) == (symbol in ("X_vr", "X_wq"))
