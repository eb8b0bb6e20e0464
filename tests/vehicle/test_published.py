"""Published nonlinear vehicles against the published equations, written and integrated here without the library."""

import jax.numpy as jnp
import numpy as np
import pytest
from rigs import stacked
from scipy.integrate import solve_ivp

from jaxsub.recording import Recording
from jaxsub.simulation import at_rest, integrate, simulate
from jaxsub.vehicle.catalogue import remus_100_nonlinear


def remus(state, delta_r, delta_s):
    """Rates of [u v w p q r φ θ ψ z] by Prestero (2001), eqs. 4.65 and after, with his appendix's numbers."""
    u, v, w, p, q, r, phi, theta, _, _ = state
    W, B, m, zg = 299.0, 306.0, 299.0 / 9.81, 0.0196
    Ixx, Iyy, Izz = 0.177, 3.45, 3.45
    s, c = np.sin, np.cos
    X = (-(W - B) * s(theta) - 1.62 * u * abs(u) + (-35.5 - m) * w * q - 1.93 * q**2 + (35.5 + m) * v * r
         - 1.93 * r**2 - m * zg * p * r + 3.86)  # fmt: skip
    Y = ((W - B) * c(theta) * s(phi) - 1310.0 * v * abs(v) + 0.632 * r * abs(r) - 28.6 * u * v + (35.5 + m) * w * p
         + (5.22 - m) * u * r - m * zg * q * r + 1.93 * p * q + 9.64 * u**2 * delta_r)  # fmt: skip
    Z = ((W - B) * c(theta) * c(phi) - 131.0 * w * abs(w) - 0.632 * q * abs(q) - 28.6 * u * w + (-5.22 + m) * u * q
         + (-35.5 - m) * v * p + m * zg * (p**2 + q**2) + 1.93 * r * p - 9.64 * u**2 * delta_s)  # fmt: skip
    K = (-zg * W * c(theta) * s(phi) - 0.13 * p * abs(p) - (Izz - Iyy) * q * r - m * zg * w * p + m * zg * u * r
         - 0.543)  # fmt: skip
    M = (-zg * W * s(theta) + 3.18 * w * abs(w) - 188.0 * q * abs(q) + (4.86 - (Ixx - Izz)) * r * p
         + m * zg * (v * r - w * q) - 2.0 * u * q + 24.0 * u * w - 1.93 * v * p - 6.15 * u**2 * delta_s)  # fmt: skip
    N = (-3.18 * v * abs(v) - 94.0 * r * abs(r) - 24.0 * u * v + (-4.86 - (Iyy - Ixx)) * p * q - 1.93 * w * p
         - 2.0 * u * r - 6.15 * u**2 * delta_r)  # fmt: skip
    inertia = np.diag([m + 0.93, m + 35.5, m + 35.5, Ixx + 0.0704, Iyy + 4.88, Izz + 4.88])
    inertia[0, 4] = inertia[4, 0] = m * zg
    inertia[1, 3] = inertia[3, 1] = -m * zg
    inertia[1, 5] = inertia[5, 1] = -1.93
    inertia[2, 4] = inertia[4, 2] = 1.93
    turning = (q * s(phi) + r * c(phi)) / c(theta)
    attitude = [p + turning * s(theta), q * c(phi) - r * s(phi), turning]
    sinking = -u * s(theta) + (v * s(phi) + w * c(phi)) * c(theta)
    return np.concatenate([np.linalg.solve(inertia, [X, Y, Z, K, M, N]), attitude, [sinking]])


TIMES = 0.05 * np.arange(161)
RUDDER = np.where(TIMES > 1.0, 0.15, 0.0) - np.where(TIMES > 4.0, 0.25, 0.0)
PLANE = np.where(TIMES > 2.0, -0.1, 0.02)


@pytest.mark.parametrize("solver", ["reference", "sampled"])
def test_remus_100_moves_by_prestero_s_equations(solver):
    """Claim: eight seconds of rudder and stern plane steps differ by less than 1e-6, by both integrators."""
    vehicle = remus_100_nonlinear()
    run = Recording("steps", TIMES, {"delta_r": RUDDER, "delta_s": PLANE}, "steps")
    run = Recording("steps", TIMES, run.columns | dict.fromkeys(vehicle.layout.channels, np.full(161, np.nan)), "steps")
    runs = stacked(vehicle, [run], substeps=16)
    start = at_rest(vehicle, 1).at[0, :6].set(jnp.array([1.54, 0.02, -0.03, 0.05, 0.01, -0.02]))
    if solver == "reference":
        found = integrate(vehicle, runs, start, rtol=1e-11, atol=1e-11)[0]
        names = vehicle.layout.states
    else:
        found, names = simulate(vehicle, runs, start)[0], vehicle.layout.channels
    state = np.array([1.54, 0.02, -0.03, 0.05, 0.01, -0.02, 0.0, 0.0, 0.0, 0.0])
    expected = [state]
    for delta_r, delta_s in zip(RUDDER[:-1], PLANE[:-1], strict=True):
        motion = lambda t, x, r=delta_r, s=delta_s: remus(x, r, s)
        state = solve_ivp(motion, (0.0, 0.05), state, method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
        expected.append(state)
    shown = ("u", "v", "w", "p", "q", "r", "phi", "theta", "psi", "z")
    found = np.stack([np.asarray(found)[:, names.index(name)] for name in shown], axis=1)
    assert np.abs(np.array(expected)[:, shown.index("psi")]).max() > 0.3
    np.testing.assert_allclose(found, expected, atol=1e-6)
