"""Sensors show what one that is late, turned, off the centre, at its end or without sign shows, as NumPy has it."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from samples import BODY, motion
from scipy.spatial.transform import Rotation

from jaxsub.effects import (
    EQUATIONS,
    SensorDelay,
    SensorDrift,
    SensorLeverArm,
    SensorMisalignment,
    SensorRectification,
    SensorSaturation,
    SensorScale,
    admissible,
)

NOW = motion(BODY, count=50)
TIMES = np.cumsum(np.random.default_rng(1).uniform(0.05, 0.3, 50))
TRUTH = {c: np.random.default_rng(i).normal(size=50) for i, c in enumerate(("r", "z", "u", "ax", "az", "x", "y"))}
TRUTH |= {"v": TRUTH["u"] ** 2, "w": TRUTH["u"] ** 3, "ay": TRUTH["ax"] ** 2, "depth": TRUTH["z"]}


def read(effect, times=TIMES, truth=TRUTH):
    found = effect.show(jnp.asarray(times), {c: jnp.asarray(y) for c, y in truth.items()}, NOW)
    assert tuple(found) == effect.channels
    return np.asarray(found[effect.channel]) if len(found) == 1 else found


def test_delay_is_the_line_between_the_samples_a_while_ago():
    found = read(SensorDelay("r", jnp.asarray(0.33)))
    for k, t in enumerate(TIMES):
        i = np.searchsorted(TIMES, t - 0.33) - 1
        if i < 0:
            assert found[k] == TRUTH["r"][0]
            continue
        part = (t - 0.33 - TIMES[i]) / (TIMES[i + 1] - TIMES[i])
        assert found[k] == pytest.approx((1.0 - part) * TRUTH["r"][i] + part * TRUTH["r"][i + 1], abs=1e-12)


def test_delay_of_whole_samples_is_a_shift():
    found = read(SensorDelay("r", jnp.asarray(0.3)), 0.1 * np.arange(50))
    np.testing.assert_allclose(found[3:], TRUTH["r"][:-3], atol=1e-12)


def test_drift_grows_from_the_start_of_the_run():
    np.testing.assert_allclose(read(SensorDrift("r", jnp.asarray(0.02))), TRUTH["r"] + 0.02 * TIMES, rtol=1e-14)


def test_limits_and_lost_signs_are_their_formulas():
    clipped = read(SensorSaturation("r", jnp.asarray(0.7)))
    np.testing.assert_allclose(clipped, [min(max(y, -0.7), 0.7) for y in TRUTH["r"]])
    np.testing.assert_allclose(read(SensorRectification("r", jnp.asarray(1.0))), [abs(y) for y in TRUTH["r"]])
    half = [y if y > 0.0 else 0.0 for y in TRUTH["r"]]
    np.testing.assert_allclose(read(SensorRectification("r", jnp.asarray(0.5))), half, atol=1e-15)


def test_rectification_is_suspected_only_of_what_may_be_negative():
    assert {e.channel for e in SensorRectification.candidates(BODY)} == {"r", "theta", "ax", "depth_rate"}


def test_a_turned_sensor_sees_the_other_axis():
    turned = lambda own, other: np.cos(0.6) * own + np.sin(0.6) * other
    epsilon = jnp.asarray(0.6)
    np.testing.assert_allclose(read(SensorMisalignment("r", "p", epsilon)), turned(TRUTH["r"], NOW.rates["roll"]))
    np.testing.assert_allclose(read(SensorMisalignment("ax", "az", epsilon)), turned(TRUTH["ax"], TRUTH["az"]))
    pairs = {(e.channel, e.sees) for e in SensorMisalignment.candidates(BODY)}
    # nothing records the other two specific forces
    assert pairs == {("u", "v"), ("u", "w"), ("r", "p"), ("r", "q")}


def test_a_gyro_turned_about_an_axis_shows_the_rate_in_the_turned_frame():
    turning = rows(EQUATIONS[3:], NOW.rates)
    truth = TRUTH | dict(zip("pqr", turning.T, strict=True))
    for axis, (own, others) in enumerate((("q,r", "r,q"), ("r,p", "p,r"), ("p,q", "q,p"))):
        found = read(SensorMisalignment(own, others, jnp.asarray(0.6)), truth=truth)
        expected = Rotation.from_rotvec(0.6 * np.eye(3)[axis]).inv().apply(turning)
        for channel, shown in found.items():
            np.testing.assert_allclose(shown, expected[:, "pqr".index(channel)], rtol=1e-12)


def test_an_instrument_of_several_channels_is_suspected_whole():
    log = dataclasses.replace(BODY, channels=("v", "w", "q", "r", "p"))
    arms = {(e.channel, e.axis) for e in SensorLeverArm.candidates(log) if len(e.channels) > 1}
    assert arms == {("v,w", "x")}
    turned = {(e.channel, e.sees) for e in SensorMisalignment.candidates(log) if len(e.channels) > 1}
    assert turned == {("v,w", "w,v"), ("q,r", "r,q"), ("r,p", "p,r"), ("p,q", "q,p")}
    arm = read(SensorLeverArm("v,w", "x", jnp.asarray(0.6)))
    for channel in "vw":
        np.testing.assert_array_equal(arm[channel], read(SensorLeverArm(channel, "x", jnp.asarray(0.6))))


def rows(names, source):
    return np.stack([source[name] for name in names], 1)


@pytest.mark.parametrize("axis", range(3))
def test_a_sensor_off_the_centre_moves_with_the_body(axis):
    arm = np.zeros(3)
    arm[axis] = 0.6
    angles = np.stack([NOW.positions[name] for name in ("psi", "theta", "phi")], -1)
    turning, spin = rows(EQUATIONS[3:], NOW.rates), rows(EQUATIONS[3:], NOW.accelerations)
    arms = np.broadcast_to(arm, turning.shape)
    moved = {
        ("u", "v", "w"): np.cross(turning, arms),
        ("x", "y", "z"): Rotation.from_euler("ZYX", angles).apply(arm),
        ("ax", "ay", "az"): np.cross(spin, arms) + np.cross(turning, np.cross(turning, arms)),
    }
    for triad, expected in moved.items():
        for i, channel in enumerate(triad):
            found = read(SensorLeverArm(channel, "xyz"[axis], jnp.asarray(0.6)))
            np.testing.assert_allclose(found - TRUTH[channel], expected[:, i], rtol=1e-10, atol=1e-12)
    deep = read(SensorLeverArm("depth", "xyz"[axis], jnp.asarray(0.6)))
    np.testing.assert_allclose(deep, read(SensorLeverArm("z", "xyz"[axis], jnp.asarray(0.6))))


def test_lever_arms_are_suspected_where_they_show():
    found = {(e.channel, e.axis) for e in SensorLeverArm.candidates(BODY)}
    assert found == {("u", "y"), ("u", "z"), ("z", "x"), ("z", "y"), ("ax", "x"), ("ax", "y"), ("ax", "z")}


def test_a_sensor_is_off_by_no_more_than_what_it_should_show():
    """Claim: a scale wrong by up to its own size is a sensor's error, and a larger one is refused as a way out."""
    allowed = [admissible(SensorScale("u"), {"scale": scale}) for scale in (-22.0, -1.01, -0.3, 0.0, 0.99, 1.01, 22.0)]
    assert allowed == [False, False, True, True, True, False, False]
