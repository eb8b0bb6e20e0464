"""Concealed hydrostatic effects; extra lift is turned into body axes by the attitude's rotation matrix."""

import jax.numpy as jnp

from .truth import GRAVITY, WATER, Truth


def _attitude(m):
    phi, theta = m.positions["phi"], m.positions["theta"]
    down = jnp.array([-jnp.sin(theta), jnp.sin(phi) * jnp.cos(theta), jnp.cos(phi) * jnp.cos(theta)])
    return down


def _up(m, newton):
    force = -newton * _attitude(m)
    return {"surge": force[0], "sway": force[1], "heave": force[2]}


def _moment(m, arm, newton):
    """arm × force, of a weight (positive down) at `arm` m from the centre of gravity."""
    turned = jnp.cross(jnp.asarray(arm), newton * _attitude(m))
    return dict(zip(("roll", "pitch", "yaw"), turned, strict=True))


def _trim(axis: int, limit: float) -> Truth:
    places = (("pitch", "yaw"), ("roll", "yaw"), ("roll", "pitch"))[axis]
    return Truth(
        "trim-offset", "xyz"[axis], "hydrostatics", places, limit,
        force=lambda a, m: _moment(m, a * jnp.eye(3)[axis], -m.motion.buoyancy),
        numbers=lambda a: {f"delta_{'xyz'[axis]}_B": a},
    )  # fmt: skip


def _shift(axis: int, start: float, limit: float) -> Truth:
    """A tenth of the weight moves `a` m at `start` s: the moment is that of the whole weight over a tenth of it."""
    places = (("pitch", "yaw"), ("roll", "yaw"))[axis]
    return Truth(
        "mass-shift", f"{'xy'[axis]} at {start:g} s", "hydrostatics", places, limit,
        force=lambda a, m: _moment(m, jnp.where(m.t >= start, a, 0.0) * jnp.eye(3)[axis], 0.1 * m.motion.buoyancy),
        numbers=lambda a: {f"delta_{'xy'[axis]}_G": 0.1 * a, "t_0": start},
    )  # fmt: skip


def temperature(z):
    """A thermocline of 12 K over depth z (m), K."""
    return 288.15 - 6.0 * jnp.tanh((z - 12.0) / 6.0)


HYDROSTATICS = (
    _trim(0, 0.05),
    _trim(1, 0.05),
    _trim(2, 0.1),
    Truth(
        "buoyancy-error", "constant", "hydrostatics", ("heave", "surge"), 2e3,
        force=lambda a, m: _up(m, a), numbers=lambda a: {"delta_B": a},
    ),
    Truth(
        "hull-compressibility", "depth", "hydrostatics", ("heave", "surge"), 1e-5,
        force=lambda a, m: _up(m, -m.motion.buoyancy * a * WATER * GRAVITY * m.positions["z"]),
        numbers=lambda a: {"kappa": a},
    ),
    Truth(
        "density-stratification", "depth", "hydrostatics", ("heave", "surge"), 1e-1,
        force=lambda a, m: _up(m, m.motion.buoyancy * a * m.positions["z"]),
        numbers=lambda a: {"gamma": a},
    ),
    Truth(
        "thermal-expansion", "hull", "hydrostatics", ("heave", "surge"), 1e-1, vehicle="nps-temperature",
        force=lambda a, m: _up(m, m.motion.buoyancy * a * (temperature(m.positions["z"]) - 288.15)),
        numbers=lambda a: {"alpha": a},
    ),
    _shift(0, 70.0, 0.5),
    _shift(1, 55.0, 0.5),
)  # fmt: skip
