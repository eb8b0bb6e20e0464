"""From body velocities to rates of attitude and position."""

from collections.abc import Mapping

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..arrays import Values, namespace
from ..effects import GRAVITY, Motion, Signal


@jax.custom_jvp
def sine_cosine(angle: Float[Array, " *k"]) -> tuple[Float[Array, " *k"], Float[Array, " *k"]]:
    """Sine and cosine of `angle` (rad), worked out once.

    Without the barrier XLA fuses both into everything that uses them and works them out again in each: eighty times in
    a step in place of sixteen, which was a third of the time that a batch of simulations took.
    """
    return jax.lax.optimization_barrier((jnp.sin(angle), jnp.cos(angle)))


@sine_cosine.defjvp
def _(primals: tuple[Array], tangents: tuple[Array]) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    sine, cosine = sine_cosine(*primals)
    return (sine, cosine), (cosine * tangents[0], -sine * tangents[0])


def position_rates(motion: Motion) -> dict[str, Signal]:
    r"""Euler rates and velocity over ground (equations.md §1).

    $\dot\psi = (q\sin\phi + r\cos\phi)/\cos\theta$, $\dot\theta = q\cos\phi - r\sin\phi$,
    $\dot\phi = p + \dot\psi\sin\theta$, and $[\dot x\,\dot y\,\dot z] = R(\phi,\theta,\psi)[u\,v\,w]$ with z down.
    """
    u, v, w, p, q, r = (motion.rates[e] for e in ("surge", "sway", "heave", "roll", "pitch", "yaw"))
    phi, theta, psi = (motion.positions[name] for name in ("phi", "theta", "psi"))
    (sin_phi, cos_phi), (sin_theta, cos_theta) = sine_cosine(jnp.asarray(phi)), sine_cosine(jnp.asarray(theta))
    turning = (q * sin_phi + r * cos_phi) / cos_theta
    across = v * cos_phi - w * sin_phi
    ahead = u * cos_theta + (v * sin_phi + w * cos_phi) * sin_theta
    return {
        "psi": turning,
        "theta": q * cos_phi - r * sin_phi,
        "phi": p + turning * sin_theta,
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
    phi, theta = motion.positions["phi"], motion.positions["theta"]
    down = stack({"x": -jnp.sin(theta), "y": jnp.sin(phi) * jnp.cos(theta), "z": jnp.cos(phi) * jnp.cos(theta)}, "xyz")
    lever = jnp.asarray(arm)
    centripetal = jnp.cross(angular, jnp.cross(angular, jnp.broadcast_to(lever, angular.shape)))
    tangential = jnp.cross(angular_rate, jnp.broadcast_to(lever, angular.shape))
    total = linear_rate + jnp.cross(angular, linear) + tangential + centripetal - GRAVITY * down
    return {"ax": total[..., 0], "ay": total[..., 1], "az": total[..., 2]}
