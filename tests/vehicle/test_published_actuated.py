"""Published vehicles with actuators against the published equations, integrated here without the library."""

import jax.numpy as jnp
import numpy as np
import pytest
from rigs import stacked
from scipy.integrate import solve_ivp

from jaxsub.recording import Recording
from jaxsub.simulation import at_rest, integrate, prbs, simulate
from jaxsub.vehicle.catalogue import bluerov2_heavy, kvlcc2, otter


def turn(angle):
    """J₃ of von Benzon et al. (2022): about the z axis."""
    return np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])


def bluerov2(state, volts):
    """Rates of [u v w p q r φ θ ψ z] by von Benzon et al. (2022), with table A1."""
    nu, (phi, theta, _) = state[:6], state[6:9]
    m, g, V, zb = 13.5, 9.82, 0.0134, -0.01
    added = [6.36, 7.12, 18.68, 0.189, 0.135, 0.222]
    linear, square = [13.7, 0.0, 33.0, 0.0, 0.8, 0.0], [141.0, 217.0, 190.0, 1.19, 0.47, 1.5]
    M = np.diag([m, m, m, 0.26, 0.23, 0.37]) + np.diag(added)
    u, v, w, p, q, r = nu
    mu, mv, mw, Ip, Iq, Ir = np.diag(M)
    # C(ν) of a diagonal inertia, Fossen (2021), theorem 3.2
    C = np.array([
        [0, 0, 0, 0, mw * w, -mv * v], [0, 0, 0, -mw * w, 0, mu * u], [0, 0, 0, mv * v, -mu * u, 0],
        [0, mw * w, -mv * v, 0, Ir * r, -Iq * q], [-mw * w, 0, mu * u, -Ir * r, 0, Ip * p],
        [mv * v, -mu * u, 0, Iq * q, -Ip * p, 0],
    ])  # fmt: skip
    W, B = m * g, 1000.0 * g * V
    s, c = np.sin, np.cos
    gravity = np.array([(W - B) * s(theta), -(W - B) * c(theta) * s(phi), -(W - B) * c(theta) * c(phi),
                        -zb * B * c(theta) * s(phi), -zb * B * s(theta), 0.0])  # fmt: skip
    ahead = np.array([1.0, -1.0, 0.0]) / np.sqrt(2.0)
    sides = [(1, 1, 0.0), (1, -1, np.pi / 2), (-1, 1, 3 * np.pi / 2), (-1, -1, np.pi)]
    places = [np.array([0.156 * x, 0.111 * y, 0.085]) for x, y, _ in sides]
    places += [np.array([0.12 * x, 0.218 * y, 0.0]) for x, y, _ in sides]
    pushes = [turn(angle) @ ahead for *_, angle in sides] + [np.array([0.0, 0.0, -1.0])] * 4
    force = -140.3 * volts**9 + 389.9 * volts**7 - 404.1 * volts**5 + 176.0 * volts**3 + 8.9 * volts
    tau = sum(np.concatenate([f * d, np.cross(a, f * d)]) for f, a, d in zip(force, places, pushes, strict=True))
    drag = (np.array(linear) + np.array(square) * abs(nu)) * nu
    turning = (q * s(phi) + r * c(phi)) / c(theta)
    attitude = [p + turning * s(theta), q * c(phi) - r * s(phi), turning]
    sinking = -u * s(theta) + (v * s(phi) + w * c(phi)) * c(theta)
    return np.concatenate([np.linalg.solve(M, tau - C @ nu - drag - gravity), attitude, [sinking]])


def mmg(state, inputs):
    """Rates of [u v r ψ] of KVLCC2's 7 m model by Yasukawa and Yoshimura (2015), eqs. 4-27 with tables 1-3."""
    (u, v, r, _), (delta, omega) = state, inputs
    rho, L, d, D, A_R, x_G, n = 1000.0, 7.0, 0.46, 0.216, 0.0539, 0.25, omega / (2.0 * np.pi)
    m = rho * 3.27
    m_x, m_y, J_z = (0.5 * rho * L**2 * d * k for k in (0.022, 0.223, 0.011 * L**2))
    I_G = m * (0.25 * L) ** 2
    U = np.hypot(u, v)
    v_, r_, beta = v / U, r * L / U, np.arctan2(-v, u)
    X_H = -0.022 - 0.040 * v_**2 + 0.002 * v_ * r_ + 0.011 * r_**2 + 0.771 * v_**4
    Y_H = -0.315 * v_ + 0.083 * r_ - 1.607 * v_**3 + 0.379 * v_**2 * r_ - 0.391 * v_ * r_**2 + 0.008 * r_**3
    N_H = -0.137 * v_ - 0.049 * r_ - 0.030 * v_**3 - 0.294 * v_**2 * r_ + 0.055 * v_ * r_**2 - 0.013 * r_**3
    beta_P = beta + 0.48 * r_
    w = 1.0 - 0.6 * (1.0 + (1.0 - np.exp(-2.0 * abs(beta_P))) * (0.6 if beta_P > 0 else 0.1))
    J = u * (1.0 - w) / (n * D)
    K_T = 0.2931 - 0.2753 * J - 0.1385 * J**2
    v_R = U * (0.640 if beta + 0.710 * r_ > 0 else 0.395) * (beta + 0.710 * r_)
    race = 0.626 * (1.0 + 0.5 * (np.sqrt(1.0 + 8.0 * K_T / (np.pi * J**2)) - 1.0)) ** 2 + 1.0 - 0.626
    u_R = 1.09 * u * (1.0 - w) * np.sqrt(race)
    F_N = 0.5 * rho * A_R * (u_R**2 + v_R**2) * 2.747 * np.sin(delta - np.arctan(v_R / u_R))
    force = 0.5 * rho * L * d * U**2
    X = force * X_H + 0.78 * rho * n**2 * D**4 * K_T - (1.0 - 0.387) * F_N * np.sin(delta)
    Y = force * Y_H - (1.0 + 0.312) * F_N * np.cos(delta)
    N = force * L * N_H - (-0.5 - 0.312 * 0.464) * L * F_N * np.cos(delta)
    matrix = np.array([[m + m_y, x_G * m], [x_G * m, I_G + x_G**2 * m + J_z]])
    rates = np.linalg.solve(matrix, [Y - (m + m_x) * u * r, N - x_G * m * u * r])
    return np.array([(X + (m + m_y) * v * r + x_G * m * r**2) / (m + m_x), *rates, r])


def catamaran(state, commands):
    """Rates of [u v r ψ] and of both shaft speeds of the Otter by Fossen's otter.py, strips by Gauss's 16 points."""
    (u, v, r, _), shafts = state[:4], state[4:]
    rho, g, m, m_p, L, B_pont, y_pont = 1025.0, 9.81, 55.0, 25.0, 2.0, 0.25, 0.395
    x_g = m * 0.2 / (m + m_p)
    inertia = m * (0.25 * L) ** 2 + m * x_g**2
    draught = (m + m_p) / rho / (2.0 * 0.4 * B_pont * L)
    M = m + m_p
    rigid = np.array([[M, 0, 0], [0, M, M * x_g], [0, M * x_g, inertia + M * x_g**2]])
    added = np.diag([0.1 * m, 1.5 * m, 1.7 * inertia])
    X_u, N_r = -24.4 * g / (6.0 * 0.5144), -(rigid + added)[2, 2] / 1.0
    k_pos, k_neg = 0.02216 / 2.0, 0.01289 / 2.0
    held = np.clip(shafts, -np.sqrt(0.5 * 13.6 * g / k_neg), np.sqrt(0.5 * 24.4 * g / k_pos))
    thrust = np.where(held > 0.0, k_pos, k_neg) * held * abs(held)
    C_d = np.interp(B_pont / (2.0 * draught), [0.5585, 0.6464], [1.0836, 0.9986])  # Hoerner's curve, two of its points
    x, weights = (part * L / 2.0 for part in np.polynomial.legendre.leggauss(16))
    strips = -0.5 * rho * draught * C_d * abs(v + x * r) * (v + x * r) * weights
    m_x, m_y = added[0, 0], added[1, 1]
    force = np.array([
        thrust.sum() + X_u * u + M * (v * r + x_g * r**2) + m_y * v * r,
        strips.sum() - M * u * r - m_x * u * r,
        (x * strips).sum() + y_pont * (thrust[0] - thrust[1]) + N_r * r + 10.0 * N_r * abs(r) * r - M * x_g * u * r,
    ])  # fmt: skip
    return np.concatenate([np.linalg.solve(rigid + added, force), [r], (commands - shafts) / 1.0])


def volts(seed):
    return {f"t{i + 1}": prbs(201, 12, 0.7, seed=seed + i) for i in range(8)}


ROV_TIMES, SHIP_TIMES = 0.02 * np.arange(201), 0.2 * np.arange(201)
ZIGZAG = {"delta": np.deg2rad(20.0) * np.sign(np.sin(0.35 * SHIP_TIMES) + 1e-9), "n": np.full(201, 2 * np.pi * 10.4)}
SHAFTS = {"n1": 110.0 - 60.0 * (ROV_TIMES > 2.0), "n2": 40.0 - 100.0 * (ROV_TIMES > 1.5)}
RUNS = {
    "bluerov2": (bluerov2_heavy, bluerov2, ROV_TIMES, volts(3), "u v w p q r phi theta psi z", {}, 0.3),
    "otter": (otter, catamaran, ROV_TIMES, SHAFTS, "u v r psi", {"u": 0.5, "v": 0.2, "r": 0.3}, 0.3),
    "kvlcc2": (kvlcc2, mmg, SHIP_TIMES, ZIGZAG, "u v r psi", {"u": 1.179, "v": 0.05}, 0.2),
}


@pytest.mark.parametrize("solver", ["reference", pytest.param("sampled", marks=pytest.mark.long)])
@pytest.mark.parametrize("case", RUNS)
def test_vehicle_moves_by_the_published_equations(case, solver):
    """Claim: four seconds of an ROV and a catamaran and a ship's zigzag of forty differ by less than 1e-6."""
    make, rates, times, columns, names, begun, moved = RUNS[case]
    vehicle, shown, step = make(), names.split(), float(times[1])
    columns = columns | dict.fromkeys(vehicle.layout.channels, np.full(len(times), np.nan))
    runs = stacked(vehicle, [Recording("run", times, columns, "run")], substeps=16)
    states = vehicle.layout.states
    start = at_rest(vehicle, 1)
    for name, value in begun.items():
        start = start.at[0, states.index(name)].set(value)
    if solver == "reference":
        found, there = integrate(vehicle, runs, start, rtol=1e-11, atol=1e-11)[0], states
    else:
        found, there = simulate(vehicle, runs, start)[0], vehicle.layout.channels
    inputs = np.stack([columns[name] for name in vehicle.layout.held], axis=1)
    state = np.asarray(jnp.stack([start[0, states.index(name)] for name in shown]))
    # shafts that follow their commands start at these
    state = np.concatenate([state, inputs[0] if case == "otter" else []])
    expected = [state]
    for held in inputs[:-1]:
        motion = lambda t, x, c=held: rates(x, c)
        state = solve_ivp(motion, (0.0, step), state, method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
        expected.append(state)
    found = np.stack([np.asarray(found)[:, there.index(name)] for name in shown], axis=1)
    expected = np.array(expected)[:, : len(shown)]
    assert np.abs(expected[:, shown.index("psi")]).max() > moved
    np.testing.assert_allclose(found, expected, atol=1e-6)
