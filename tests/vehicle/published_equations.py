"""Equations of published vehicles in NumPy, from their sources and without the library."""

import numpy as np

G = 9.80665


def skew(a):
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def coriolis(M, nu):
    """C(ν) of the inertia M, Fossen (2021), theorem 3.2."""
    linear, angular = skew(M[:3] @ nu), skew(M[3:] @ nu)
    return np.block([[np.zeros((3, 3)), -linear], [-linear, -angular]])


def attitude_rates(nu, phi, theta):
    """Rates of φ, θ, ψ and z, Fossen (2021), §2.2."""
    (u, v, w, p, q, r), s, c = nu, np.sin, np.cos
    turning = (q * s(phi) + r * c(phi)) / c(theta)
    sinking = -u * s(theta) + (v * s(phi) + w * c(phi)) * c(theta)
    return [p + turning * s(theta), q * c(phi) - r * s(phi), turning, sinking]


def restoring(W, B, phi, theta, z_G=0.0, z_B=0.0):
    """Minus g(η), Fossen (2021), eq. 4.6."""
    s, c, lever = np.sin, np.cos, z_G * W - z_B * B
    return np.array([
        -(W - B) * s(theta), (W - B) * c(theta) * s(phi), (W - B) * c(theta) * c(phi),
        -lever * c(theta) * s(phi), -lever * s(theta), 0.0,
    ])  # fmt: skip


def wing(lift, drag, along, across):
    """Forces ahead and across of a lift across the flow and a drag along it."""
    U = np.hypot(along, across)
    return lift * across / U - drag * along / U, -lift * along / U - drag * across / U


def suboff(t, state, inputs):
    """Rates of [u w q θ z] by Gertler and Hagen (1967) with table 4 of Roddy (1990)."""
    (u, w, q, theta, _), (delta, thrust) = state, inputs
    rho, L, m = 1000.0, 4.2608602, 709.09
    force, moment = 0.5 * rho * L**2, 0.5 * rho * L**3
    Z = force * (-0.01391 * u * w - 0.007545 * L * u * q - 0.005603 * u**2 * delta)
    M = moment * (0.010324 * u * w - 0.003702 * L * u * q - 0.002409 * u**2 * delta)
    inertia = np.array([
        [m + 0.014529 * moment, 0.000633 * moment * L], [0.000561 * moment * L, 804.6 + 0.00086 * moment * L**2],
    ])  # fmt: skip
    heave, pitch = np.linalg.solve(inertia, [Z + m * u * q, M])
    surge = (thrust - 10.992 * u * abs(u) - m * w * q) / m
    return np.array([surge, heave, pitch, q, -u * np.sin(theta) + w * np.cos(theta)])


def seaglider(t, state, inputs, pitch, roll):
    """Rates of [u w z] by Eriksen et al. (2001), with added mass."""
    (u, w, _), (volume,) = state, inputs
    theta, phi, rho, length = pitch(t), roll(t), 1027.5, 1.8
    U, angle = np.hypot(u, w), np.degrees(w / np.hypot(u, w))
    pressure = 0.5 * rho * length**2 * U**2
    lift = pressure * 0.004 * angle
    drag = pressure * (0.01 * (0.5 * rho * 0.25**2) ** -0.25 + 5.7e-5 * angle**2)
    X, Z = wing(lift, drag, u, w)
    up = rho * G * volume
    ahead = X + up * np.sin(theta)
    down = Z - up * np.cos(theta) * np.cos(phi)
    sinking = -u * np.sin(theta) + w * np.cos(phi) * np.cos(theta)
    return np.array([ahead / (52.0 + 2.3495), down / (52.0 + 47.69), sinking])


def slocum(t, state, inputs):
    """Rates of [u w q θ z] by Graver (2005), the mass that moves held where it is."""
    (u, w, q, theta, _), (ballast, place) = state, inputs
    m1, m3, J, U = 50.0 + 5.0, 50.0 + 70.0, 12.0, np.hypot(u, w)
    angle = w / U
    X, Z = wing(132.5 * angle * U**2, (2.15 + 25.0 * angle**2) * U**2, u, w)
    moment = -100.0 * angle * U**2 - 50.0 * q + (m3 - m1) * u * w
    moment -= 9.0 * G * (0.05 * np.sin(theta) + place * np.cos(theta))
    surge = (X - ballast * G * np.sin(theta) - m3 * w * q) / m1
    heave = (Z + ballast * G * np.cos(theta) + m1 * u * q) / m3
    return np.array([surge, heave, moment / J, q, -u * np.sin(theta) + w * np.cos(theta)])


def torpedo(t, state, commands):
    """Rates of [u v w p q r φ θ ψ z, four fins, shaft] by torpedo.py and actuator.py of Fossen's simulator."""
    nu, (phi, theta), deflections = state[:6], state[6:8], state[10:]
    u, v, w, _, q, r = nu
    rho, a, b, g, z_G, U = 1026.0, 0.8, 0.095, 9.81, 0.02, np.linalg.norm(nu[:3])
    m = 4.0 / 3.0 * np.pi * rho * a * b**2
    I_x, I_y = 0.4 * m * b**2, 0.2 * m * (a**2 + b**2)
    H = np.eye(6)
    H[:3, 3:] = skew([0.0, 0.0, z_G]).T
    rigid = H.T @ np.diag([m, m, m, I_x, I_y, I_y]) @ H
    e = np.sqrt(1.0 - (b / a) ** 2)
    alpha = 2.0 * (1.0 - e**2) / e**3 * (0.5 * np.log((1.0 + e) / (1.0 - e)) - e)
    beta = 1.0 / e**2 - (1.0 - e**2) / (2.0 * e**3) * np.log((1.0 + e) / (1.0 - e))
    k1, k2 = alpha / (2.0 - alpha), beta / (2.0 - beta)
    k3 = e**4 * (beta - alpha) / ((2.0 - e**2) * (2.0 * e**2 - (2.0 - e**2) * (beta - alpha)))
    added = np.diag([m * k1, m * k2, m * k2, 0.3 * I_x, k3 * I_y, k3 * I_y])
    C_A, M = coriolis(added, nu), rigid + added
    for row, column in ((4, 0), (0, 4), (4, 2), (2, 4), (5, 0), (0, 5), (5, 1), (1, 5)):
        C_A[row, column] = 0.0
    rolled, pitched = (np.sqrt(m * g * z_G / M[i, i]) for i in (3, 4))
    D = np.diag([0.0, 0.0, M[2, 2] / 20.0, 0.6 * rolled * M[3, 3], 1.6 * pitched * M[4, 4], M[5, 5]])
    S = 0.7 * 1.6 * 0.19
    C_D0, aspect, pressure = 0.42 * np.pi * b**2 / S, 0.19**2 / S, 0.5 * rho * S * U**2
    C_L = np.pi * aspect / (1.0 + np.sqrt(1.0 + (aspect / 2.0) ** 2)) * w / U
    # the angle of attack is w/U, so the flow is split as that ratio says
    lift, drag = pressure * C_L, pressure * (C_D0 + C_L**2 / (np.pi * 0.7 * aspect))
    tau = np.zeros(6)
    tau[0], tau[2] = lift * w / U - drag * u / U, -lift * u / U - drag * w / U
    x, weights = (part * a for part in np.polynomial.legendre.leggauss(16))
    C_d = np.interp(0.5, [0.4933, 0.5585], [1.2108, 1.0836])
    strips = -0.5 * rho * 0.19 * C_d * abs(v + x * r) * (v + x * r) * weights
    tau[1], tau[5] = strips.sum(), (x * strips).sum()
    for angle, C, delta in zip(np.radians([270.0, 90.0, 180.0, 0.0]), [0.5, 0.5, 0.7, 0.7], deflections, strict=False):
        held = np.clip(delta, -np.radians(15.0), np.radians(15.0))
        place = np.array([-a, 0.1 * np.cos(angle), 0.1 * np.sin(angle)])
        ahead = u - place[1] * r + place[2] * q  # of the fin's own place
        size = 0.5 * rho * 0.00665 * C * held * ahead * abs(ahead)
        force = size * np.array([0.0, np.sin(angle), -np.cos(angle)])
        tau += np.concatenate([force, np.cross(place, force)])
    n, D_p, ahead = np.clip(deflections[4], -159.7, 159.7) / (2.0 * np.pi), 0.14, 0.944 * u
    K_T = 0.4566 + (0.1798 - 0.4566) / 0.6632 * ahead / (n * D_p)
    K_Q = 0.0700 + (0.0312 - 0.0700) / 0.6632 * ahead / (n * D_p)
    tau[0] += 0.9 * rho * D_p**4 * n**2 * K_T
    tau[3] += rho * D_p**5 * n**2 * K_Q / 10.0
    forces = tau - (coriolis(rigid, nu) + C_A + D) @ nu + restoring(m * g, m * g, phi, theta, z_G=z_G)
    return np.concatenate([np.linalg.solve(M, forces), attitude_rates(nu, phi, theta), (commands - deflections) / 0.1])


def rexrov(t, state, commands):
    """Rates of [u v w p q r φ θ ψ z, eight rotors] by the Gazebo model of Manhães et al. (2016), turned to z down."""
    nu, (phi, theta, _, z), rotors = state[:6], state[6:10], state[10:]
    m, g, rho = 1862.87, 9.81, 1028.0
    M = np.diag([m, m, m, 525.39, 794.20, 691.23]) + np.diag([779.79, 1222.0, 3659.9, 534.9, 842.69, 224.32])
    for row, column, value in ((0, 2, -103.32), (0, 4, -165.54), (1, 3, 409.44), (2, 4, -386.42)):
        M[row, column] = M[column, row] = value
    linear = [74.82, 69.48, 728.4, 268.8, 309.77, 105.0]
    square = [748.22, 992.53, 1821.01, 672.0, 774.44, 523.27]
    tau = -(np.array(linear) + np.array(square) * abs(nu)) * nu
    level, raised = (0.412125, 0.505415, 0.129), (0.890895, 0.334385, 0.528822)
    # as in its file, x ahead, y to port and z up: place, pitch and heading of each
    mounts = [((-1, 1, 1), raised, -74.53, -53.21), ((-1, -1, 1), raised, -74.53, 53.21)]
    mounts += [((1, 1, 1), raised, -105.47, 53.21), ((1, -1, 1), raised, -105.47, -53.21)]
    mounts += [((-1, 1, 1), level, 0.0, 45.0), ((-1, -1, 1), level, 0.0, -45.0)]
    mounts += [((1, 1, 1), level, 0.0, 135.0), ((1, -1, 1), level, 0.0, -135.0)]
    for (side, size, pitch, heading), n in zip(mounts, rotors, strict=True):
        a, b = np.radians(pitch), np.radians(heading)
        place, along = np.multiply(side, size), [np.cos(a) * np.cos(b), np.cos(a) * np.sin(b), -np.sin(a)]
        down = np.array([1.0, -1.0, -1.0])
        force = 0.00031 * n * abs(n) * down * along
        tau += np.concatenate([force, np.cross(down * place, force)])
    tau[:3] -= 0.5 * rho * 1.2 * 0.03 * z * np.linalg.norm(nu[:3]) * nu[:3]
    forces = tau - coriolis(M, nu) @ nu + restoring(m * g, rho * g * 1.83826, phi, theta, z_B=-0.3)
    return np.concatenate([np.linalg.solve(M, forces), attitude_rates(nu, phi, theta), (commands - rotors) / 0.05])
