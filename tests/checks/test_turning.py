"""Angles lose their jumps wherever they stand: measured, prescribed, a mechanism's."""

import dataclasses

import numpy as np
from check_cases import changed, clean, found, vehicle_named
from rigs import oscillator

from jaxsub.checks import check
from jaxsub.recording import Recording
from jaxsub.recording.runs import stack_runs
from jaxsub.recording.turns import unwrapped_mechanism
from jaxsub.vehicle import vehicle_from

TURN = 2.0 * np.pi


def prescribed():
    return vehicle_from(
        {
            "schema": 1, "name": "track", "kind": "submerged-body", "dof": ["surge"],
            "body": {"mass": 60.0, "speed": 1.5, "inertia": [1.0, 12.0, 12.0]}, "coefficients": {"X_u": -15.0},
            "inputs": {"thrust": "T"}, "prescribed": {"psi": "heading"},
            "outputs": {"u": {"sigma": 0.01}},
        },
        "track.toml",
    )  # fmt: skip


def turning_run():
    times = 0.5 * np.arange(200)
    heading = np.mod(0.3 * times, TURN)
    push = np.sign(np.sin(0.3 * times)) + 1.5
    columns = {"T": push, "heading": heading, "u": 1.5 + 0.01 * np.random.default_rng(0).standard_normal(200)}
    return Recording("turn", times, columns, "turn.csv")


def test_a_prescribed_heading_is_unwrapped_with_a_note():
    checked = check(prescribed(), [turning_run()])
    (finding,) = found(checked, "wrapped-angle")
    assert (finding.severity, finding.channel, finding.count) == ("note", "heading", 4)
    np.testing.assert_allclose(checked.recordings[0].columns["heading"], 0.3 * turning_run().times, atol=1e-12)


def test_stacking_unwraps_a_prescribed_heading_too():
    layout = prescribed().layout
    columns = {"held": layout.held, "interpolated": layout.interpolated, "channels": layout.channels}
    runs = stack_runs([turning_run()], **columns, angles=layout.angles)
    np.testing.assert_allclose(np.asarray(runs.signals)[0, :, 1], 0.3 * turning_run().times, atol=1e-12)


def test_a_heading_that_turns_too_fast_for_its_samples_is_warned_about():
    run = turning_run()
    fast = changed(run, heading=np.mod(3.6 * run.times, TURN))
    (finding,) = found(check(prescribed(), [fast]), "wrapped-angle")
    assert finding.severity == "warning"


def test_a_measured_heading_is_unwrapped():
    run = clean("nps")
    shifted = np.mod(run.columns["psi"] - np.median(run.columns["psi"]), TURN)
    checked = check(vehicle_named("nps"), [changed(run, psi=shifted)])
    (finding,) = found(checked, "wrapped-angle")
    whole = checked.recordings[0].columns["psi"]
    assert finding.count > 0 and np.max(np.abs(np.diff(whole))) < 0.1


def test_the_angle_of_a_mechanism_is_unwrapped_about_zero():
    run = clean("oscillator")
    checked = check(oscillator(), [changed(run, x=np.mod(run.columns["x"], TURN))])
    assert found(checked, "wrapped-angle")[0].severity == "note"
    np.testing.assert_allclose(checked.recordings[0].columns["x"], run.columns["x"], atol=1e-9)
    metres = dataclasses.replace(changed(run, x=np.mod(run.columns["x"], TURN)), units={"x": "m"})
    assert not found(check(oscillator(), [metres]), "wrapped-angle")


def test_what_is_no_angle_keeps_its_jumps():
    draws = np.random.default_rng(0)
    steps = np.repeat(draws.choice([0.0, 6.0], 20), 10) + 0.01 * draws.standard_normal(200)
    assert unwrapped_mechanism(np.abs(steps)) is None
    assert unwrapped_mechanism(draws.uniform(0.0, TURN, 200)) is None
    assert unwrapped_mechanism(np.linspace(0.0, 40.0, 200)) is None
