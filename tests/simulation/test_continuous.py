"""The continuous model is the paper's equations, whose derivatives survive the jumps of held inputs."""

import dataclasses
from itertools import pairwise

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from rigs import driven, oscillator, stacked
from scipy.integrate import solve_ivp

from jaxsub.effects import QuadraticDamping
from jaxsub.simulation import at_rest, integrate, sampled_states
from jaxsub.vehicle.catalogue import nps_auv_ii

AWRY = {"weight": 53400.0, "buoyancy": 53900.0, "x_B": 0.01, "y_B": -0.02, "z_B": -0.061}


def nps():
    """The NPS vehicle with every restoring term at work."""
    return nps_auv_ii().with_values({name: jnp.asarray(value) for name, value in AWRY.items()})


def paper(state, delta, c):
    """The first paper's eq. 1, misprints corrected, with the coefficients `c`."""
    u, v, w, p, q, r, phi, theta, _, _ = state
    delta_r, delta_er, delta_el = delta
    m, U, W, B = c["mass"], c["speed"], c["weight"], c["buoyancy"]
    x_B, y_B, z_B = c["x_B"], c["y_B"], c["z_B"]
    sphi, cphi, sth, cth = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta)
    du = (c["X_u"] * u + c["X_0"] - (W - B) * sth) / (m - c["X_udot"])
    sway = c["Y_v"] * v + c["Y_p"] * p + (c["Y_r"] - m * U) * r + (W - B) * sphi * cth + c["Y_delta_r"] * delta_r
    roll = c["K_v"] * v + c["K_p"] * p + c["K_r"] * r - y_B * B * cphi * cth + z_B * B * sphi * cth
    roll += c["K_delta_er"] * delta_er - c["K_delta_el"] * delta_el
    yaw = c["N_v"] * v + c["N_p"] * p + c["N_r"] * r - x_B * B * sphi * cth - y_B * B * sth
    yaw += c["N_delta_r"] * delta_r
    lateral = np.array([
        [m - c["Y_vdot"], -c["Y_pdot"], -c["Y_rdot"]],
        [-c["K_vdot"], c["I_x"] - c["K_pdot"], -c["K_rdot"]],
        [-c["N_vdot"], -c["N_pdot"], c["I_z"] - c["N_rdot"]],
    ])  # fmt: skip
    dv, dp, dr = np.linalg.solve(lateral, [sway, roll, yaw])
    delta_e = 0.5 * (delta_er + delta_el)
    heave = c["Z_w"] * w + (c["Z_q"] + m * U) * q + (W - B) * cphi * cth + c["Z_delta_e"] * delta_e
    pitch = c["M_w"] * w + c["M_q"] * q + x_B * B * cphi * cth + z_B * B * sth + c["M_delta_e"] * delta_e
    vertical = np.array([[m - c["Z_wdot"], -c["Z_qdot"]], [-c["M_wdot"], c["I_y"] - c["M_qdot"]]])
    dw, dq = np.linalg.solve(vertical, [heave, pitch])
    dpsi = (q * sphi + r * cphi) / cth
    dz = -u * sth + v * sphi * cth + w * cphi * cth
    return np.array([du, dv, dw, dp, dq, dr, p + dpsi * sth, q * cphi - r * sphi, dpsi, dz])


def test_states_are_those_of_the_printed_equations():
    vehicle = nps()
    recording = driven(vehicle, np.array([0.0, 0.3, 1.0, 2.2, 2.5, 4.0]), seed=1, amplitude=0.2, hold=1)
    start = np.array([1.7, 0.2, -0.1, 0.1, 0.05, -0.1, 0.3, -0.2, 0.4, 1.0])
    states = integrate(vehicle, stacked(vehicle, [recording]), jnp.asarray(start)[None], rtol=1e-11, atol=1e-11)[0]
    coefficients = {name: float(value) for name, value in vehicle.values().items()}
    inputs = recording.inputs(vehicle.layout.held)
    state = start
    for k, (begin, end) in enumerate(pairwise(recording.times)):
        rates = lambda _, y, delta=inputs[k]: paper(y, delta, coefficients)
        state = solve_ivp(rates, (begin, end), state, method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
        np.testing.assert_allclose(states[k + 1], state, rtol=1e-8, atol=1e-9)


@pytest.mark.parametrize("states", [integrate, sampled_states])
@pytest.mark.parametrize("what", ["coefficient", "input"])
def test_derivatives_through_jumps_are_central_differences(states, what):
    vehicle = nps_auv_ii()
    runs = stacked(vehicle, [driven(vehicle, 0.5 * np.arange(10), seed=2, hold=2)])
    start = at_rest(vehicle, 1)
    value, step = (vehicle.values()["Y_delta_r"], 1.0) if what == "coefficient" else (runs.signals[0, 4, 0], 1e-4)

    @jax.jit
    def final(value):
        if what == "coefficient":
            return states(vehicle.with_values({"Y_delta_r": value}), runs, start)[0, -1]
        held = runs.signals.at[0, 4, 0].set(value)
        return states(vehicle, dataclasses.replace(runs, signals=held), start)[0, -1]

    slope = jax.jit(lambda value: jax.jvp(final, (value,), (jnp.ones(()),))[1])(value)
    difference = (final(value + step) - final(value - step)) / (2.0 * step)
    scale = np.abs(difference).max()
    assert np.abs(difference[1]) > 1e-3 * scale > 0.0
    np.testing.assert_allclose(slope, difference, rtol=1e-5, atol=1e-5 * scale)


def test_reverse_mode_gives_the_derivative_of_forward_mode():
    vehicle = oscillator()
    runs = stacked(vehicle, [driven(vehicle, 0.5 * np.arange(6), seed=2, hold=2)])

    def position(value, adjoint):
        moved = vehicle.with_values({"B_x_drive": value})
        return integrate(moved, runs, at_rest(vehicle, 1), adjoint=adjoint)[0, -1, 1]

    value = vehicle.values()["B_x_drive"]
    forward = jax.jacfwd(position)(value, diffrax.ForwardMode())
    reverse = jax.grad(position)(value, diffrax.RecursiveCheckpointAdjoint())
    assert abs(forward) > 1e-3
    np.testing.assert_allclose(reverse, forward, rtol=1e-9)


def test_a_run_that_diverges_is_nan_from_there_and_harms_no_other():
    calm = nps_auv_ii()
    wild = calm.with_effect(QuadraticDamping("sway", jnp.asarray(1e5)))
    runs = stacked(wild, [driven(wild, 0.5 * np.arange(5), seed=3)] * 2)
    start = at_rest(wild, 2).at[0, 1].set(3.0)
    states = integrate(wild, runs, start)
    assert np.isfinite(states[0, 0]).all()
    assert np.isnan(states[0, 1:]).all()
    assert np.isfinite(states[1]).all()
