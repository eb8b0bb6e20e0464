"""Files of a glider's mission, flown by equations of its own: the hull shrinks with pressure, and drag is quadratic.

The vehicle file has neither: its hull is stiff, and its drag is linear. All dives are integrated at once by Runge-Kutta
steps of a twentieth of a sample, in NumPy.
"""

import csv
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy import ndarray

GRAVITY = 9.81  # m/s²
INTERVAL, STEPS = 10.0, 20  # s between samples, and integration steps in that
SIGMA = 0.005  # m/s, of the vertical speed
MASS, DISPLACED, DENSITY = 53.125, 520.98, 1027.5  # kg, N, kg/m³
ADDED = (3.0, 50.0)  # kg, in surge and heave
DRAG, LIFT = 8.0, 60.0  # N s²/m² in surge, N s/m in heave
KAPPA = 4.6e-10  # 1/Pa
CONCEALED = ("hull-compressibility", "quadratic-damping")
VEHICLE = f"""schema = 1
name = "Glider of a mission"
kind = "submerged-body"
dof = ["surge", "heave"]
[body]
mass = {MASS}
buoyancy = {{ value = {DISPLACED + 0.4}, free = true }}
inertia = [1.0, 10.0, 10.0]
speed = 0.0
length = 1.8
diameter = 0.3
reference_density = {DENSITY}
[coefficients]
X_udot = {{ value = -{ADDED[0]}, fixed = true }}
Z_wdot = {{ value = -{ADDED[1]}, fixed = true }}
X_u = {{ value = -3.0 }}
Z_w = {{ value = -45.0 }}
[prescribed]
theta = "theta"
z = "z"
[environment]
ballast = "vbd"
density = "rho"
[outputs.depth_rate]
sigma = {SIGMA}
"""


def write_mission(folder: Path, dives: int, samples: int, seed: int = 1) -> list[Path]:
    """`vehicle.toml` and a file for each dive of so many samples in `folder`; the files of the dives in order."""
    folder.mkdir(parents=True)
    (folder / "vehicle.toml").write_text(VEHICLE, encoding="utf-8")
    rng = np.random.default_rng([seed, dives, samples])
    t = INTERVAL * np.arange(samples)
    pitch, ballast = _commands(t, dives, rng)
    stratified = rng.uniform(1.0, 2.5, dives)[:, None]
    density = lambda z: 1025.0 + stratified * np.tanh(z / 120.0) + 4.5e-6 * DENSITY * z
    z, rate = _flown(t, pitch, ballast, density)
    measured = rate + SIGMA * rng.standard_normal(rate.shape)
    paths = []
    for dive in range(dives):
        columns = {
            "t": t,
            "theta": pitch(t)[dive],
            "z": z[dive],
            "vbd": ballast(t)[dive],
            "rho": density(z)[dive],
            "depth_rate": measured[dive],
        }
        paths.append(folder / f"dive{dive + 1:03d}.csv")
        with paths[-1].open("w", newline="", encoding="utf-8") as file:
            rows = csv.writer(file)
            rows.writerow(columns)
            rows.writerows([f"{value:.9g}" for value in row] for row in zip(*columns.values(), strict=True))
    return paths


def _commands(t: ndarray, dives: int, rng: np.random.Generator) -> tuple[Callable, Callable]:
    """Pitch (rad) and displaced volume (m³) by time, (dives, …): down, then up, each dive at angles of its own."""
    draw = lambda low, high: rng.uniform(low, high, dives)[:, None]
    turn, steep, heavy = 0.5 * t[-1] * draw(0.9, 1.1), draw(0.25, 0.5), draw(1.0e-4, 2.0e-4)
    swing, period, phase = draw(0.02, 0.06), draw(300.0, 900.0), draw(0.0, 6.28)
    side = lambda t: np.tanh((t - turn) / 60.0)
    pitch = lambda t: steep * side(t) + swing * np.sin(2.0 * np.pi * t / period + phase)
    return pitch, lambda t: heavy * side(t)


def _flown(t: ndarray, pitch: Callable, ballast: Callable, density: Callable) -> tuple[ndarray, ndarray]:
    """Depth (m) and vertical speed (m/s, positive down) at the samples, (dives, samples)."""
    h, volume = INTERVAL / STEPS, DISPLACED / (DENSITY * GRAVITY)

    def descent(t: float, state: ndarray) -> ndarray:
        theta = pitch(t)[:, 0]
        return -state[0] * np.sin(theta) + state[1] * np.cos(theta)

    def rates(t: float, state: ndarray) -> ndarray:
        u, w, z = state
        theta, rho = pitch(t)[:, 0], density(z[:, None])[:, 0]
        shrunk = 1.0 - KAPPA * DENSITY * GRAVITY * z
        heavy = MASS * GRAVITY - (volume + ballast(t)[:, 0]) * rho * GRAVITY * shrunk
        surge = (-heavy * np.sin(theta) - DRAG * u * np.abs(u)) / (MASS + ADDED[0])
        heave = (heavy * np.cos(theta) - LIFT * w) / (MASS + ADDED[1])
        return np.stack([surge, heave, descent(t, state)])

    state = np.stack([np.zeros(len(pitch(0.0))), np.zeros(len(pitch(0.0))), np.full(len(pitch(0.0)), 20.0)])
    depths, speeds = [state[2]], [descent(0.0, state)]
    for sample in t[:-1]:
        for step in range(STEPS):
            at = sample + h * step
            first = rates(at, state)
            second = rates(at + h / 2, state + h / 2 * first)
            third = rates(at + h / 2, state + h / 2 * second)
            state = state + h / 6 * (first + 2 * second + 2 * third + rates(at + h, state + h * third))
        depths.append(state[2])
        speeds.append(descent(sample + INTERVAL, state))
    return np.stack(depths, axis=1), np.stack(speeds, axis=1)
