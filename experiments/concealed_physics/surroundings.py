"""Concealed effects of the propeller and of the surroundings."""

import math

import jax.numpy as jnp

from .truth import Truth

BOTTOM = 40.0


def _push(m):
    """What the propeller makes of its speed, over that at 60 rad/s."""
    n = m.actuators["shaft_speed"]
    return abs(n) * n / 3600.0


def over_ground(m):
    """Rows of the rotation from body to north, east, down: the first two."""
    phi, theta, psi = (m.positions[k] for k in ("phi", "theta", "psi"))
    s, c = jnp.sin, jnp.cos
    north = [c(psi) * c(theta), c(psi) * s(theta) * s(phi) - s(psi) * c(phi),
             c(psi) * s(theta) * c(phi) + s(psi) * s(phi)]  # fmt: skip
    east = [s(psi) * c(theta), s(psi) * s(theta) * s(phi) + c(psi) * c(phi),
            s(psi) * s(theta) * c(phi) - c(psi) * s(phi)]  # fmt: skip
    return jnp.stack(north), jnp.stack(east)


_SET = (0.8, 0.6)


def _current(a, m):
    """Water that flows with `a` m/s: damping of the velocity through it, and inertia as it turns in the body's axes."""
    north, east = over_ground(m)
    stream, turning = a * (_SET[0] * north + _SET[1] * east), jnp.stack([m.rates[e] for e in ("roll", "pitch", "yaw")])
    names = ("surge", "sway", "heave", "roll", "pitch", "yaw")
    more = m.motion.inertia[:, :3] @ jnp.cross(stream, turning) - m.damping[:, :3] @ stream
    return dict(zip(names, more, strict=True))


def _wave(equation: str, omega: float, limit: float) -> Truth:
    letter = {"heave": "Z", "roll": "K", "pitch": "M"}[equation]
    return Truth(
        "wave-forcing", equation, "environment", (equation,), limit,
        force=lambda a, m: {equation: a * jnp.cos(omega * m.t + 0.7)},
        numbers=lambda a: {
            f"{letter}_cos": a * math.cos(0.7), f"{letter}_sin": -a * math.sin(0.7), "omega": omega
        },
    )  # fmt: skip


def _suction(name: str, vehicle: str, clearance, scale: float, sign: float, limit: float) -> Truth:
    def force(a, m):
        pull = sign * a * m.rates["surge"] ** 2 * jnp.exp(-jnp.maximum(clearance(m), 0.0) / scale)
        return {"heave": pull, "pitch": 1.2 * pull}

    numbers = lambda a: {"Z_suction": sign * a, "M_suction": 1.2 * sign * a, "h": scale}
    return Truth(name, "heave", "environment", ("heave", "pitch"), limit, vehicle, force=force, numbers=numbers)


def tether(a, m):
    """A line from the surface, as long as the body is deep: drag in proportion to its length."""
    velocity = jnp.stack([m.rates[e] for e in ("surge", "sway", "heave")])
    drag = -a * m.positions["z"] * jnp.sqrt(velocity @ velocity + 1e-9) * velocity
    return dict(zip(("surge", "sway", "heave"), drag, strict=True))


def _propulsion(name: str, form: str, where: tuple[str, ...], limit: float, force, numbers=lambda a: {}) -> Truth:
    return Truth(name, form, "propulsion", where, limit, force=force, numbers=numbers)


def _thrust(m):
    """Thrust of the catalogue's body at cruise, N, at this shaft speed."""
    return 363.0 * _push(m)


SURROUNDINGS = (
    _propulsion(
        "propeller-torque", "roll", ("roll",), 3e3, lambda a, m: {"roll": a * _push(m)},
        lambda a: {"K_Q": a / 3600.0},
    ),
    _propulsion(
        "propeller-asymmetry", "yaw", ("yaw",), 3e3, lambda a, m: {"yaw": a * _push(m)},
        lambda a: {"N_nn": a / 3600.0},
    ),
    _propulsion(
        "thrust-loss", "at 60 s", ("surge",), 1.0,
        lambda a, m: {"surge": -jnp.where(m.t >= 60.0, a, 0.0) * _thrust(m)},
        lambda a: {"f": a * 363.0 / 3600.0, "t_0": 60.0},
    ),
    _propulsion(
        "thruster-cross-coupling", "rudder on roll", ("roll",), 3e4, lambda a, m: {"roll": a * m.actuators["rudder"]},
        lambda a: {"K_rudder": a},
    ),
    Truth("current", "steady", "environment", ("sway", "surge", "yaw", "heave", "roll", "pitch"), 1.0, force=_current,
          numbers=lambda a: {"V_N": _SET[0] * a, "V_E": _SET[1] * a}),
    _wave("heave", 0.9, 1e4),
    _wave("roll", 1.4, 1e3),
    _wave("pitch", 0.6, 1e4),
    _suction("free-surface-suction", "nps-shallow", lambda m: m.positions["z"], 2.0, -1.0, 3e4),
    _suction("bottom-suction", "nps-altitude", lambda m: BOTTOM - m.positions["z"], 3.0, 1.0, 1e4),
    Truth("tether-drag", "to the surface", "environment", ("surge", "sway", "heave"), 300.0, force=tether,
          numbers=lambda a: {"c": a}),
)  # fmt: skip
