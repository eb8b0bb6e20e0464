"""A body's attitude as Euler angles or as a quaternion: the direction down, and the rates of either."""

from collections.abc import Mapping, Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..arrays import Values, namespace
from ..effects import Motion, Signal

EULER = ("phi", "theta", "psi")
# the scalar part less 1 and the vector part: zeros of a level body, as of every other state
QUATERNION = ("quaternion_0", "quaternion_1", "quaternion_2", "quaternion_3")
# cos² θ below which roll and heading are not told apart
_VERTICAL = 1e-20


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


def down(positions: Mapping[str, Signal]) -> tuple[Signal, Signal, Signal]:
    r"""The downward direction in body axes, $(-\sin\theta, \sin\phi\cos\theta, \cos\phi\cos\theta)$."""
    if QUATERNION[0] in positions:
        low = turned(positions)[2]
        return low[0], low[1], low[2]
    (sin_phi, cos_phi), (sin_theta, cos_theta) = (sine_cosine(jnp.asarray(positions[a])) for a in EULER[:2])
    return -sin_theta, sin_phi * cos_theta, cos_phi * cos_theta


def turned(positions: Mapping[str, Signal]) -> list[list[Signal]]:
    """Rows of the rotation from body axes to those of the earth, of a quaternion of any length."""
    less, x, y, z = (positions[name] for name in QUATERNION)
    w = 1.0 + less
    double = 2.0 / (w * w + x * x + y * y + z * z)
    return [
        [1.0 - double * (y * y + z * z), double * (x * y - w * z), double * (x * z + w * y)],
        [double * (x * y + w * z), 1.0 - double * (x * x + z * z), double * (y * z - w * x)],
        [double * (x * z - w * y), double * (y * z + w * x), 1.0 - double * (x * x + y * y)],
    ]


def euler_angles(positions: Mapping[str, Signal]) -> dict[str, Signal]:
    """Roll, pitch and heading (rad) of a quaternion, pitch within 90° either way.

    Of a vertical body roll is zero, and heading the turn that is left.
    """
    ahead, across, low = turned(positions)
    xp = namespace(low[0])
    level = low[1] ** 2 + low[2] ** 2
    vertical = level < _VERTICAL
    # what arctan2 is not given of a vertical body has no slope there
    chosen = lambda there, here: xp.where(vertical, there, here)
    return {
        "phi": xp.arctan2(chosen(0.0, low[1]), chosen(1.0, low[2])),
        "theta": xp.arctan2(-low[0], xp.sqrt(chosen(_VERTICAL, level))),
        "psi": xp.arctan2(chosen(-ahead[1], across[0]), chosen(across[1], ahead[0])),
    }


def quaternion_of(angles: Sequence[float] | Float[Values, " 3"]) -> Float[np.ndarray, " 4"]:
    """The quaternion states of roll, pitch and heading (rad)."""
    (cf, ct, cp), (sf, st, sp) = (part(0.5 * np.asarray(angles)) for part in (np.cos, np.sin))
    scalar = cf * ct * cp + sf * st * sp
    vector = (sf * ct * cp - cf * st * sp, cf * st * cp + sf * ct * sp, cf * ct * sp - sf * st * cp)
    return np.array([scalar - 1.0, *vector])


def quaternion_rates(motion: Motion) -> dict[str, Signal]:
    r"""$\dot\eta = -\tfrac12\epsilon\cdot\omega$, $\dot\epsilon = \tfrac12(\eta\omega + \epsilon\times\omega)$.

    Source: Fossen (2021), §2.2.2.
    """
    less, x, y, z = (motion.positions[name] for name in QUATERNION)
    p, q, r = (motion.rates[e] for e in ("roll", "pitch", "yaw"))
    w = 1.0 + less
    rates = (-(x * p + y * q + z * r), w * p + y * r - z * q, w * q + z * p - x * r, w * r + x * q - y * p)
    return {name: 0.5 * rate for name, rate in zip(QUATERNION, rates, strict=True)}
