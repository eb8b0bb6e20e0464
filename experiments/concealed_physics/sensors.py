"""Concealed sensor effects, and those of the one-coordinate rig."""

import jax.numpy as jnp

from .truth import Truth


def _sensor(name: str, channel: str, limit: float, shown, numbers=lambda a: {}, vehicle: str = "nps") -> Truth:
    """A truth that shows `shown(a, t, y)` of the channel's true `y`."""
    return Truth(
        name, channel, "sensors", (f"sensor:{channel}",), limit, vehicle,
        sense=lambda a, t, c: {channel: shown(a, t, c[channel])}, numbers=numbers,
    )  # fmt: skip


def late(a, t, y):
    return jnp.interp(t - a, t, y)


def _turned(a, t, c):
    """A rate gyro turned by `a` rad about the body's x axis."""
    return {"q": c["q"] * jnp.cos(a) + c["r"] * jnp.sin(a), "r": c["r"] * jnp.cos(a) - c["q"] * jnp.sin(a)}


def _levered(a, t, c):
    """A Doppler log `a` m ahead of the centre of gravity."""
    return {"v": c["v"] + a * c["r"], "w": c["w"] - a * c["q"]}


def _clipped(a, t, y):
    return jnp.clip(y, -1.0 / a, 1.0 / a)


SENSORS = (
    *(_sensor("sensor-bias", c, 0.3, lambda a, t, y: y + a, lambda a: {"bias": a}) for c in ("r", "q", "v")),
    *(_sensor("sensor-scale", c, 0.9, lambda a, t, y: (1 + a) * y, lambda a: {"scale": a}) for c in ("r", "psi", "u")),
    *(_sensor("sensor-delay", c, 10.0, late, lambda a: {"tau": a}) for c in ("psi", "r")),
    Truth("sensor-misalignment", "q,r", "sensors", ("sensor:q", "sensor:r"), 0.7, sense=_turned),
    Truth("sensor-lever-arm", "v,w", "sensors", ("sensor:v", "sensor:w"), 20.0, sense=_levered),
    _sensor("sensor-saturation", "r", 200.0, _clipped, lambda a: {"limit": 1.0 / a}),
    _sensor("sensor-rectification", "r", 1.0, lambda a, t, y: (1.0 - a) * y + a * jnp.abs(y), lambda a: {"f": a}),
    *(_sensor("sensor-drift", c, 0.1, lambda a, t, y: y + a * (t - t[0]), lambda a: {"drift": a}) for c in ("psi",)),
    _sensor("sensor-bias", "q", 0.3, lambda a, t, y: y + a, lambda a: {"bias": a}, vehicle="dsrv"),
)


def _rig(name: str, limit: float, force, numbers=lambda a: {}, **memory) -> Truth:
    return Truth(name, "x", "mechanisms", ("x",), limit, "rig", force=force, numbers=numbers, **memory)


def _bouc_wen(a, m):
    """z' = (x' - |x'||z| sgn(z)/2 - x' z²/2 …) of first order, over a yield displacement of 0.2."""
    rate, z = m.rates["x"], m.memory
    return (rate - 0.5 * (abs(rate) * z + rate * abs(z))) / 0.2


MECHANISMS = (
    _rig("coulomb-friction", 4.0, lambda a, m: {"x": -a * jnp.tanh(m.rates["x"] / 2e-3)}, lambda a: {"F_c": a}),
    _rig("cubic-stiffness", 300.0, lambda a, m: {"x": -a * m.positions["x"] ** 3}, lambda a: {"k_3": a}),
    _rig("hysteresis", 4.0, lambda a, m: {"x": -a * m.memory[0]},
         numbers=lambda a: {"F_h": a, "x_y": 0.2}, memory=1, memory_rates=_bouc_wen),
    _rig(
        "saturation", 30.0, lambda a, m: {"x": -a * m.positions["x"] / jnp.sqrt(0.25 + m.positions["x"] ** 2)},
    ),
)  # fmt: skip
