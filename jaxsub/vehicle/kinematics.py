"""From body velocities to rates of attitude and position."""

from collections.abc import Mapping

import jax.numpy as jnp
from jaxtyping import Array, Float

from ..arrays import Values, namespace
from ..effects import GRAVITY, Motion, Signal
from .attitude import EULER, QUATERNION, down, quaternion_rates, sine_cosine, turned


def position_rates(motion: Motion) -> dict[str, Signal]:
    r"""Euler rates and velocity over ground. Source: Fossen (2021), §2.2.

    $\dot\psi = (q\sin\phi + r\cos\phi)/\cos\theta$, $\dot\theta = q\cos\phi - r\sin\phi$,
    $\dot\phi = p + \dot\psi\sin\theta$, and $[\dot x\,\dot y\,\dot z] = R(\phi,\theta,\psi)[u\,v\,w]$ with z down.
    Of an attitude by a quaternion also that one's rates.
    """
    u, v, w, p, q, r = (motion.rates[e] for e in ("surge", "sway", "heave", "roll", "pitch", "yaw"))
    phi, theta, psi = (motion.positions[name] for name in EULER)
    (sin_phi, cos_phi), (sin_theta, cos_theta) = sine_cosine(jnp.asarray(phi)), sine_cosine(jnp.asarray(theta))
    turning = (q * sin_phi + r * cos_phi) / cos_theta
    angles = {"psi": turning, "theta": q * cos_phi - r * sin_phi, "phi": p + turning * sin_theta}
    if QUATERNION[0] in motion.positions:
        moved = [row[0] * u + row[1] * v + row[2] * w for row in turned(motion.positions)]
        return angles | quaternion_rates(motion) | dict(zip("xyz", moved, strict=True))
    across = v * cos_phi - w * sin_phi
    ahead = u * cos_theta + (v * sin_phi + w * cos_phi) * sin_theta
    return angles | {
        "x": ahead * jnp.cos(psi) - across * jnp.sin(psi),
        "y": ahead * jnp.sin(psi) + across * jnp.cos(psi),
        "z": -u * sin_theta + (v * sin_phi + w * cos_phi) * cos_theta,
    }


def rotation(
    phi: Float[Values, " *k"], theta: Float[Values, " *k"], psi: Float[Values, " *k"]
) -> Float[Values, "*k 3 3"]:
    r"""$R(\phi, \theta, \psi) = R_z(\psi)R_y(\theta)R_x(\phi)$, angles in rad: from turned axes to the fixed ones."""
    xp = namespace(phi, theta, psi)
    (sf, cf), (st, ct), (sp, cp) = ((xp.sin(angle), xp.cos(angle)) for angle in (phi, theta, psi))
    rows = (
        (cp * ct, cp * st * sf - sp * cf, cp * st * cf + sp * sf),
        (sp * ct, sp * st * sf + cp * cf, sp * st * cf - cp * sf),
        (-st, ct * sf, ct * cf),
    )
    return xp.stack([xp.stack(xp.broadcast_arrays(*row, cp * ct)[:3], -1) for row in rows], -2)


def to_earth(positions: Mapping[str, Signal]) -> Float[Array, "*k 3 3"]:
    """The rotation from body axes to those of the earth at the attitude `positions`."""
    if QUATERNION[0] in positions:
        return jnp.stack([jnp.stack(jnp.broadcast_arrays(*row), -1) for row in turned(positions)], -2)
    return jnp.asarray(rotation(*(jnp.asarray(positions[name]) for name in EULER)))


def specific_force(
    motion: Motion, acceleration: Mapping[str, Signal], arm: tuple[float, float, float]
) -> dict[str, Array]:
    r"""What an accelerometer at `arm` (m from the origin of the body's axes) shows, m/s².

    $f = \dot\nu_1 + \nu_2\times\nu_1 + \dot\nu_2\times l + \nu_2\times(\nu_2\times l) - R^T g$.
    """
    stack = lambda named, keys: jnp.stack(jnp.broadcast_arrays(*(named[k] for k in keys)), -1)
    linear, angular = stack(motion.rates, ("surge", "sway", "heave")), stack(motion.rates, ("roll", "pitch", "yaw"))
    linear_rate = stack(acceleration, ("surge", "sway", "heave"))
    angular_rate = stack(acceleration, ("roll", "pitch", "yaw"))
    low = jnp.stack(jnp.broadcast_arrays(*down(motion.positions)), -1)
    lever = jnp.asarray(arm)
    centripetal = jnp.cross(angular, jnp.cross(angular, jnp.broadcast_to(lever, angular.shape)))
    tangential = jnp.cross(angular_rate, jnp.broadcast_to(lever, angular.shape))
    total = linear_rate + jnp.cross(angular, linear) + tangential + centripetal - GRAVITY * low
    return {"ax": total[..., 0], "ay": total[..., 1], "az": total[..., 2]}
