"""A small AUV in the plane as it truly moves, with faults that set in: equations of its own, by Runge and Kutta."""

from typing import NamedTuple

import numpy as np

from jaxsub.recording import Recording
from jaxsub.vehicle import AbstractVehicle, vehicle_from

DT = 0.2
# s from the start of a run until a fault sets in
ONSET = 600.0
# s over which drag grows
GROWTH = 3600.0
FAULTS = (
    "thruster loses 20 %", "fin sticks", "current sets in", "drag grows 10 % in an hour",
    "compass jumps", "speed log is off", "gyro is off",
)  # fmt: skip
# of the forces in surge and sway (N) and the moment in yaw (N m) that come and go within some seconds
DISTURBANCE, SLOWNESS = np.array([1.0, 1.0, 0.5]), 3.0
SIGMA = np.array([0.01, 0.01, 0.003, 0.01])
_INERTIA = np.array([65.0, 120.0, 32.0])
# by how much sensors are off: the compass (rad), the speed log (m/s) and the gyro (rad/s)
_OFF = {"compass jumps": (3, 0.1), "speed log is off": (0, 0.03), "gyro is off": (2, 0.01)}
_DRIFT = 0.15  # m/s of the current, over ground


def vehicle() -> AbstractVehicle:
    """The vehicle's file, which is right but for what sets in."""
    linear = {"X_u": -10.0, "Y_v": -80.0, "N_r": -30.0, "N_v": -10.0}
    added = {"X_udot": -5.0, "Y_vdot": -60.0, "N_rdot": -20.0}
    fins = {"Y_delta_r": 20.0, "N_delta_r": -15.0}
    outputs = dict(zip(("u", "v", "r", "psi"), SIGMA.tolist(), strict=True))
    return vehicle_from(
        {
            "schema": 1,
            "name": "planar AUV",
            "kind": "submerged-body",
            "dof": ["surge", "sway", "yaw"],
            "body": {"mass": 60.0, "inertia": [1.0, 12.0, 12.0], "speed": 1.5},
            "coefficients": linear | added | fins,
            "inputs": {"rudder": "delta_r", "thrust": "T"},
            "outputs": {name: {"sigma": sigma} for name, sigma in outputs.items()},
        },
        "planar.toml",
    )


class Runs(NamedTuple):
    """R runs of K samples: `rows` (R, K, 1 + 2 + 4) of time, rudder, thrust, u, v, r and psi, SI."""

    rows: np.ndarray

    def recordings(self) -> list[Recording]:
        """The same as recordings."""
        names = ("delta_r", "T", "u", "v", "r", "psi")
        return [
            Recording(f"run{i}", own[:, 0], dict(zip(names, own[:, 1:].T, strict=True)), f"run{i}")
            for i, own in enumerate(self.rows)
        ]


def simulate(faults: list[str | None], seconds: float, seed: int, coloured: bool) -> Runs:
    """Runs of so many `seconds`, each with one of `faults` or none from `ONSET` on, by the random `seed`.

    Disturbance forces act where `coloured`.
    """
    rng, R, K = np.random.default_rng(seed), len(faults), round(seconds / DT)
    steer = _held(rng, R, K, 100, 0.2)
    thrust = 15.0 + _held(rng, R, K, 150, 4.0)
    which = np.array([FAULTS.index(fault) if fault else -1 for fault in faults])
    size = DISTURBANCE if coloured else 0.0 * DISTURBANCE
    keep = np.exp(-DT / SLOWNESS)
    d = size * rng.standard_normal((R, 3))
    state = np.tile([1.5, 0.0, 0.0, 0.0], (R, 1))
    shown = np.empty((R, K, 4))
    for k in range(K):
        shown[:, k] = state
        after = keep * d + np.sqrt(1.0 - keep**2) * size * rng.standard_normal((R, 3))
        state = _step(state, k * DT, steer[:, k], thrust[:, k], which, d, after)
        d = after
    measured, late = shown + SIGMA * rng.standard_normal(shown.shape), np.arange(K) * DT >= ONSET
    for fault, (channel, size) in _OFF.items():
        measured[..., channel] += size * (late & (which == FAULTS.index(fault))[:, None])
    times = np.broadcast_to(DT * np.arange(K), (R, K))
    return Runs(np.concatenate([np.stack([times, steer, thrust], axis=-1), measured], axis=-1))


def _held(rng: np.random.Generator, runs: int, samples: int, hold: int, most: float) -> np.ndarray:
    """Levels within `most`, each held for so many samples."""
    return np.repeat(rng.uniform(-most, most, (runs, -(-samples // hold))), hold, axis=1)[:, :samples]


def _step(state, time, steer, thrust, which, d, after):
    rates = lambda x, at, push: _rates(x, at, steer, thrust, which, push)
    middle = 0.5 * (d + after)
    a = rates(state, time, d)
    b = rates(state + 0.5 * DT * a, time + 0.5 * DT, middle)
    c = rates(state + 0.5 * DT * b, time + 0.5 * DT, middle)
    e = rates(state + DT * c, time + DT, after)
    return state + DT * (a + 2.0 * b + 2.0 * c + e) / 6.0


def _rates(x, time, steer, thrust, which, push):
    u, v, r, psi = x.T
    there = (time >= ONSET) * (which[:, None] == np.arange(len(FAULTS)))
    thrust = thrust * (1.0 - 0.2 * there[:, 0])
    # it sticks a little off the middle
    steer = np.where(there[:, 1], 0.05, steer)
    north = _DRIFT * there[:, 2]
    u_w, v_w = u - north * np.cos(psi), v + north * np.sin(psi)
    drag = 10.0 * (1.0 + 0.1 * there[:, 3] * np.clip((time - ONSET) / GROWTH, 0.0, 1.0))
    force = np.stack(
        [
            -drag * u_w + thrust,
            -80.0 * v_w - 90.0 * r + 20.0 * steer,
            -10.0 * v_w - 30.0 * r - 15.0 * steer,
        ],
        axis=-1,
    )
    return np.concatenate([(force + push) / _INERTIA, r[:, None]], axis=1)
