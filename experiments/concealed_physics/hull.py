"""Concealed hull effects."""

import jax.numpy as jnp
import numpy as np

from .truth import WATER, Truth

_LETTER = {"surge": "Xu", "sway": "Yv", "heave": "Zw", "roll": "Kp", "pitch": "Mq", "yaw": "Nr"}


def _power(name: str, equation: str, power: int, limit: float) -> Truth:
    force, rate = _LETTER[equation]
    return Truth(
        name, equation, "hull", (equation,), limit,
        force=lambda a, m: {equation: -a * jnp.sign(m.rates[equation]) * abs(m.rates[equation]) ** power},
        numbers=lambda a: {f"{force}_{rate * power}": -a},
    )  # fmt: skip


def _crossflow(plane: str) -> Truth:
    """Midpoint rule over 200 strips; the arm's sign follows from the direction that a positive turn moves the bow."""
    across, turn, sign = ("sway", "yaw", 1.0) if plane == "horizontal" else ("heave", "pitch", -1.0)
    length, width = 5.3, 1.131  # m, of the NPS AUV II
    x = (np.arange(200) + 0.5) / 200 * length - length / 2

    def force(a, m):
        flow = m.rates[across] + sign * x * m.rates[turn]
        strip = -0.5 * WATER * width * (length / 200) * a * flow * abs(flow)
        return {across: strip.sum(), turn: sign * (strip * x).sum()}

    return Truth(
        "crossflow-drag", plane, "hull", (across, turn), 60.0, force=force, numbers=lambda a: {"C_d": a}
    )  # fmt: skip


def _coupling(a, m):
    """Kirchhoff's products by the rates of momentum in a turning frame, less the part linear about cruising."""
    names = ("surge", "sway", "heave", "roll", "pitch", "yaw")
    nu = jnp.stack([m.rates[e] for e in names]) - jnp.array([1.0, 0, 0, 0, 0, 0]) * m.motion.cruise
    momentum = m.motion.inertia @ nu
    p, h, v, w = momentum[:3], momentum[3:], nu[:3], nu[3:]
    cross = lambda s, t: jnp.array([s[1] * t[2] - s[2] * t[1], s[2] * t[0] - s[0] * t[2], s[0] * t[1] - s[1] * t[0]])
    total = -a * jnp.concatenate([cross(w, p), cross(w, h) + cross(v, p)])
    return dict(zip(names, total, strict=True))


def _loss(first: str, second: str, limit: float) -> Truth:
    letter = lambda e: _LETTER[e][1] if e in _LETTER else f"_{e}"
    known = lambda m: {**m.rates, **m.actuators}
    return Truth(
        "turning-speed-loss", f"{first},{second}", "hull", ("surge",), limit,
        force=lambda a, m: {"surge": -a * known(m)[first] * known(m)[second]},
        numbers=lambda a: {f"X_{letter(first)}{letter(second)}": -a},
    )  # fmt: skip


def _scaling(equation: str, variable: str, limit: float) -> Truth:
    known = lambda m: {**m.rates, **m.actuators}
    tail = _LETTER[variable][1] if variable in _LETTER else f"_{variable}"
    return Truth(
        "speed-scaling", f"{equation},{variable}", "hull", (equation,), limit,
        force=lambda a, m: {equation: -a * (m.rates["surge"] - m.motion.cruise) * known(m)[variable]},
        numbers=lambda a: {f"{_LETTER[equation][0]}_u{tail}": -a},
    )  # fmt: skip


def _asymmetry(equation: str, limit: float) -> Truth:
    return Truth(
        "hull-asymmetry", equation, "hull", (equation,), limit,
        force=lambda a, m: {equation: a},
        numbers=lambda a: {f"{_LETTER[equation][0]}_0": a},
    )  # fmt: skip


def _fluid_memory(equation: str, seconds: float, limit: float) -> Truth:
    return Truth(
        "fluid-memory", equation, "hull", (equation,), limit, memory=1,
        memory_rates=lambda a, m: (m.rates[equation] - m.memory) / seconds,
        force=lambda a, m: {equation: -a * m.memory[0]},
        numbers=lambda a: {f"{_LETTER[equation][0]}_memory": -a, "T_m": seconds},
    )  # fmt: skip


EVERY = ("surge", "sway", "heave", "roll", "pitch", "yaw")
HULL = (
    _power("quadratic-damping", "roll", 2, 3e6),
    _power("quadratic-damping", "yaw", 2, 1e7),
    _power("quadratic-damping", "sway", 2, 1e5),
    _power("quadratic-damping", "surge", 2, 3e3),
    _power("quadratic-damping", "pitch", 2, 3e7),
    _power("cubic-damping", "roll", 3, 1e8),
    _power("cubic-damping", "yaw", 3, 1e9),
    _power("cubic-damping", "sway", 3, 1e6),
    _crossflow("horizontal"),
    _crossflow("vertical"),
    Truth("coriolis-coupling", "all", "hull", EVERY, 3.0, force=_coupling, numbers=lambda a: {"fraction": a}),
    _loss("yaw", "yaw", 1e6),
    _loss("sway", "yaw", 1e5),
    _loss("rudder", "rudder", 3e4),
    _scaling("yaw", "rudder", 1e5),
    _scaling("sway", "sway", 1e5),
    _scaling("heave", "elevator_right", 1e5),
    _asymmetry("yaw", 2e3),
    _asymmetry("sway", 2e3),
    _asymmetry("roll", 2e3),
    _fluid_memory("yaw", 6.0, 1e6),
    _fluid_memory("sway", 4.0, 1e5),
)
