"""Faults of a long run, of which stretches far apart are looked at, are named as those of a short one are."""

import dataclasses
import functools

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from jaxsub.checks import check
from jaxsub.recording import Recording
from jaxsub.vehicle import vehicle_from

ROWS, STEP = 60_000, 0.05
SIGMA = {"u": 0.02, "v": 0.02, "r": 0.003, "psi": 0.01, "x": 0.3, "y": 0.3}


@functools.cache
def vessel():
    return vehicle_from(
        {
            "schema": 1, "name": "vessel", "kind": "submerged-body", "dof": ["surge", "sway", "yaw"],
            "body": {"mass": 50.0, "inertia": [1.0, 9.0, 9.0], "speed": 1.5},
            "coefficients": {"X_u": -10.0, "Y_v": -60.0, "N_r": -10.0, "N_delta_r": -12.0},
            "inputs": {"rudder": "delta_r"},
            "outputs": {name: {"sigma": sigma} for name, sigma in SIGMA.items()},
        },
        "vessel.toml",
    )  # fmt: skip


@functools.cache
def track():
    """Hours of turns, by kinematics alone: the heading goes round many times and the track a kilometre and more."""
    draws = np.random.default_rng(0)
    t = STEP * np.arange(ROWS)
    helm = np.repeat(draws.choice([-1.0, 0.5, 1.0], ROWS // 100), 100)
    smooth = np.convolve(helm, np.hanning(81) / np.hanning(81).sum(), "same")
    u, v, r = 1.5 - 0.2 * smooth**2, -0.4 * smooth, 0.15 * smooth
    integral = lambda rate: cumulative_trapezoid(rate, t, initial=0.0)
    psi = integral(r)
    x, y = integral(u * np.cos(psi) - v * np.sin(psi)), integral(u * np.sin(psi) + v * np.cos(psi))
    true = {"u": u, "v": v, "r": r, "psi": psi, "x": x, "y": y}
    noisy = {name: values + SIGMA[name] * draws.standard_normal(ROWS) for name, values in true.items()}
    return Recording("track", t, noisy | {"delta_r": -0.2 * helm}, "track.csv")


def alarms(**changed):
    run = track()
    findings = check(vessel(), [dataclasses.replace(run, columns=run.columns | changed)]).findings
    return [finding for finding in findings if finding.severity != "note"]


def test_the_run_is_one_that_is_looked_at_in_stretches():
    """Claim: between the stretches the heading goes round and the track moves on, so nothing may look across them."""
    psi, x = track().columns["psi"], track().columns["x"]
    assert abs(np.diff(psi[::6000])).max() > 2.0 * np.pi and abs(np.diff(x[::6000])).max() > 100.0


def test_a_clean_run_has_no_alarm():
    assert [finding.line() for finding in alarms()] == []


@pytest.mark.parametrize(
    ("name", "change", "kind", "channel"),
    [
        ("r", np.rad2deg, "factor", "psi"),
        ("u", lambda u: u / 0.5144444, "factor", "u"),
        ("v", np.negative, "sign", "v"),
    ],
)
def test_a_factor_and_a_sign_are_named(name, change, kind, channel):
    assert [(f.check, f.channel) for f in alarms(**{name: change(track().columns[name])})] == [(kind, channel)]


def test_a_delay_is_named_in_seconds():
    psi, rows = track().columns["psi"], 6
    (found,) = alarms(psi=np.concatenate([np.full(rows, psi[0]), psi[:-rows]]))
    assert (found.check, found.channel) == ("delay", "psi")
    assert abs(float(found.what.split()[2]) - rows * STEP) < STEP, found.what
