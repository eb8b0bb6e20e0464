"""Numbers and time series of a made-up six-degree-of-freedom vehicle that lacks a drag in sway and yaw."""

import numpy as np

from jaxsub.discrepancy.records.diagnosis import ForceTrace, Overlay

EQUATIONS = {"surge": 40.0, "sway": 900.0, "heave": 60.0, "roll": 15.0, "pitch": 120.0, "yaw": 1400.0}
CHANNELS = {
    "u": ("m/s", 0.01, 0.3), "v": ("m/s", 0.01, 0.25), "w": ("m/s", 0.01, 0.05), "p": ("rad/s", 0.0035, 0.01),
    "q": ("rad/s", 0.0035, 0.01), "r": ("rad/s", 0.0035, 0.09), "phi": ("rad", 0.005, 0.03),
    "theta": ("rad", 0.005, 0.06), "psi": ("rad", 0.005, 1.2), "z": ("m", 0.05, 2.0),
}  # fmt: skip
BEFORE = {"v": 14.3, "r": 8.72, "psi": 5.1, "phi": 2.4, "u": 1.62, "p": 1.31, "w": 1.02, "q": 0.99, "theta": 1.04}
COEFFICIENTS = (
    ("X_u", "kg/s", -396.0, -401.2, 3.1), ("X_0", "N", 725.0, 731.0, 5.7), ("Y_v", "kg/s", -2572.0, -3310.0, 41.0),
    ("Y_r", "N*s/rad", 4089.0, 3120.0, 88.0), ("Y_p", "N*s/rad", 409.0, 640.0, 510.0),
    ("Z_w", "kg/s", -7716.0, -7702.0, 65.0), ("Z_q", "N*s/rad", -19084.0, -19021.0, 210.0),
    ("K_v", "N*s", 422.6, 433.0, 12.0), ("K_p", "N*m/(rad/s)", -7948.0, -7720.0, 160.0),
    ("K_r", "N*m/(rad/s)", -607.0, -602.0, 88.0), ("M_w", "N*s", 13631.0, 13600.0, 140.0),
    ("M_q", "N*m/(rad/s)", -49134.0, -49300.0, 800.0), ("N_v", "N*s", -1008.7, -720.0, 31.0),
    ("N_r", "N*m/(rad/s)", -11561.0, -14230.0, 120.0), ("Y_delta_r", "N", 1272.0, 1268.0, 7.0),
    ("N_delta_r", "N*m/rad", -3247.0, -3251.0, 13.0), ("K_delta_er", "N*m/rad", -602.0, -602.0, float("inf")),
    ("Z_delta_e", "N", -3440.0, -3438.5, 9.1), ("M_delta_e", "N*m", -10240.0, -10251.0, 22.0),
)  # fmt: skip


def _motion(times: np.ndarray, phase: float) -> np.ndarray:
    turn = np.tanh(np.sin(2 * np.pi * times / 60.0 + phase) * 3.0)
    return turn * (1.0 + 0.2 * np.sin(times / 3.0))


def trace(make: np.random.Generator, run: str, samples: int, size: float, modelled: float = 0.0) -> ForceTrace:
    times = np.linspace(0.0, 119.9, samples)
    motion = np.where(run == "turns-1", 1.0, 0.6) * _motion(times, 0.3)
    drag = size * motion
    kernel = np.ones(15) / 15
    force, band = {}, {}
    for index, (equation, scale) in enumerate(EQUATIONS.items()):
        noise = np.convolve(make.normal(size=samples), kernel, "same") * scale * 0.25
        force[equation] = noise + (scale * drag * (-1.0) ** index if equation in ("sway", "yaw") else 0.0)
        band[equation] = scale * 0.08 * (1.0 + 5.0 * np.exp(-times / 1.5) + 5.0 * np.exp((times - 119.9) / 1.5))
    effects = {e: -modelled * scale * motion / 1.2 for e, scale in EQUATIONS.items()} if modelled else {}
    recorded = {e: one + 0.1 * EQUATIONS[e] * make.normal(size=samples) for e, one in effects.items()}
    states = {"v": 0.25 * np.cbrt(motion), "r": 0.09 * motion, "delta_r": 0.3 * np.sin(times / 5.0)}
    for values in (*effects.values(), *recorded.values(), *states.values()):
        values[-1] = np.nan
    return ForceTrace(run, times, force, band, recorded, effects, states)


def overlay(make: np.random.Generator, samples: int, missing: bool, found: bool) -> Overlay:
    times = np.linspace(0.0, 119.9, samples)
    measured, baseline, improved = {}, {}, {}
    for index, (name, (_, sigma, scale)) in enumerate(CHANNELS.items()):
        truth = scale * _motion(times, 0.4 * index)
        error = sigma * (BEFORE.get(name, 1.0) if missing else 0.1) * np.sin(times / 9.0 + index)
        measured[name] = truth + make.normal(scale=sigma, size=samples)
        baseline[name] = truth + error
        improved[name] = truth + 0.1 * error if found else baseline[name]
    measured["z"][np.arange(samples) % 10 != 0] = np.nan
    measured["v"][300:360] = np.nan
    return Overlay("turns-3", times, measured, baseline, improved)
