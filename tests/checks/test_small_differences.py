"""What is small beside a motion, or what a sensor's mounting explains, is not taken for a fault of a channel."""

import functools

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid
from scipy.ndimage import gaussian_filter1d

from jaxsub.checks import check
from jaxsub.recording import Recording
from jaxsub.vehicle import vehicle_from

STEP = 0.05
T = STEP * np.arange(3000)


def smooth(draws, size, width):
    """A random motion (samples,) of rms `size` whose changes take `width` s."""
    values = gaussian_filter1d(draws.standard_normal(T.size), width / STEP)
    return size * values / np.std(values)


def vehicle(dof, outputs):
    return vehicle_from(
        {
            "schema": 1, "name": "ship", "kind": "submerged-body", "dof": dof,
            "body": {"mass": 50.0, "inertia": [2.0, 9.0, 9.0], "speed": 1.2},
            "outputs": {name: {"sigma": 0.01} for name in outputs},
        },
        "ship.toml",
    )  # fmt: skip


def alarms(ship, columns):
    findings = check(ship, [Recording("run", T, columns, "run.csv")]).findings
    return [f for f in findings if f.check in ("delay", "clock", "factor", "sign", "axis", "drift", "contradiction")]


@pytest.mark.parametrize("seed", range(4))
def test_half_a_millimetre_that_follows_roll_later_is_no_delay(seed):
    """Claim: positions that agree with velocities to a few parts in ten thousand leave nothing to explain.

    A carriage that gives way moves the track by half a millimetre, like a mast in a roll five seconds late.
    """
    draws = np.random.default_rng(seed)
    r = smooth(draws, 0.03, 8.0)
    phi = smooth(draws, 0.03, 2.0)
    u, v = 1.2 + smooth(draws, 0.02, 10.0), -3.0 * r
    integral = lambda rate: cumulative_trapezoid(rate, T, initial=0.0)
    psi = integral(r)
    x, y = integral(u * np.cos(psi) - v * np.sin(psi)), integral(u * np.sin(psi) + v * np.cos(psi))
    y += 5e-4 * np.interp(T - 5.0, T, phi) / np.std(phi)
    noise = {"x": 3e-5, "y": 3e-5, "psi": 3e-5, "u": 1e-5, "v": 1e-5, "r": 1e-4, "phi": 1e-3}
    true = {"x": x, "y": y, "psi": psi, "u": u, "v": v, "r": r, "phi": phi}
    noisy = {name: values + noise[name] * draws.standard_normal(T.size) for name, values in true.items()}
    assert [f.line() for f in alarms(vehicle(["surge", "sway", "roll", "yaw"], noisy), noisy)] == []


@functools.cache
def tumbling(seed):
    """Roll and pitch of ±20° and a heading that sways with the roll, with the body's rates."""
    draws = np.random.default_rng(seed)
    phi, theta = smooth(draws, 0.4, 1.0), smooth(draws, 0.15, 1.0)
    psi = smooth(draws, 0.01, 1.0) + 0.2 * phi
    dphi, dtheta, dpsi = (np.gradient(angle, T) for angle in (phi, theta, psi))
    rates = np.array(
        [
            dphi - dpsi * np.sin(theta),
            dtheta * np.cos(phi) + dpsi * np.cos(theta) * np.sin(phi),
            -dtheta * np.sin(phi) + dpsi * np.cos(theta) * np.cos(phi),
        ]
    )
    angles = {"phi": phi, "theta": theta, "psi": psi}
    return {k: v + 0.002 * draws.standard_normal(T.size) for k, v in angles.items()}, rates, draws


@pytest.mark.parametrize("seed", range(4))
def test_a_gyro_that_is_mounted_askew_is_no_factor(seed):
    """Claim: 4° about one axis, which shows as a wrong size of the smallest rate, is no unit."""
    angles, rates, draws = tumbling(seed)
    p, q, r = rates + 0.07 * np.array([-rates[2], 0.0 * rates[1], rates[0]])
    noisy = {name: rate + 0.01 * draws.standard_normal(T.size) for name, rate in zip("pqr", (p, q, r), strict=True)}
    assert [f.line() for f in alarms(vehicle(["roll", "pitch", "yaw"], angles | noisy), angles | noisy)] == []


@pytest.mark.parametrize("biased", ["p", "q", "r"])
def test_the_mean_of_a_gyro_is_named_where_it_is(biased):
    angles, rates, draws = tumbling(5)
    noisy = {name: rate + 0.01 * draws.standard_normal(T.size) for name, rate in zip("pqr", rates, strict=True)}
    noisy[biased] = noisy[biased] + 0.15
    (found,) = alarms(vehicle(["roll", "pitch", "yaw"], angles | noisy), angles | noisy)
    assert found.check == "drift" and f"remove the offset of {biased}" in found.remedy, found.line()
