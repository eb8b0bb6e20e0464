r"""Quaternions [w, x, y, z] that turn body axes into navigation axes, $v_n = R(q)\,v_b$, and their Euler angles.

Body axes are x forward, y starboard, z down, navigation axes north, east, down; Euler angles are φ, θ, ψ with
$R = R_z(\psi)R_y(\theta)R_x(\phi)$. Every function has finite values and derivatives where its formula is singular.
Source: Titterton and Weston (2004), §3; the angles' half-sums as in Bernardes and Viollet (2022), PLoS ONE 17.
"""

import functools
import math

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

# the standard deviation of an angle that may be anything
UNKNOWN = math.pi / math.sqrt(3.0)
# below it, squared, the series of sine and arctangent that are used here are exact in 64 bits
_SMALL = 1e-4


def omega_matrix(w: Float[Array, "3"]) -> Float[Array, "4 4"]:
    r"""Ω(ω) of the paper's eq. 17, with $\dot q = \tfrac12\Omega(\omega)q$ for the body's rates ω, rad/s."""
    x, y, z = w
    return jnp.stack(
        [
            jnp.stack([jnp.zeros_like(x), -x, -y, -z]),
            jnp.stack([x, jnp.zeros_like(x), z, -y]),
            jnp.stack([y, -z, jnp.zeros_like(x), x]),
            jnp.stack([z, y, -x, jnp.zeros_like(x)]),
        ]
    )


def product(q: Float[Array, "4"], p: Float[Array, "4"]) -> Float[Array, "4"]:
    """Hamilton's product, R(q p) = R(q) R(p)."""
    w, x, y, z = q
    a, b, c, d = p
    return jnp.stack(
        [
            w * a - x * b - y * c - z * d,
            w * b + x * a + y * d - z * c,
            w * c - x * d + y * a + z * b,
            w * d + x * c - y * b + z * a,
        ]
    )


def conjugate(q: Float[Array, "4"]) -> Float[Array, "4"]:
    """The inverse of a quaternion of unit length."""
    return jnp.concatenate([q[:1], -q[1:]])


def exponential(v: Float[Array, "3"]) -> Float[Array, "4"]:
    r"""The quaternion of a rotation by |v| rad about v: $[\cos\tfrac{|v|}2,\ \sin\tfrac{|v|}2\,v/|v|]$."""
    squared = squared_length(v)
    small = squared < _SMALL
    angle = jnp.sqrt(jnp.where(small, 1.0, squared))
    cosine = jnp.where(small, 1.0 - squared / 8.0 + squared**2 / 384.0, jnp.cos(angle / 2.0))
    ratio = jnp.where(small, 0.5 - squared / 48.0 + squared**2 / 3840.0, jnp.sin(angle / 2.0) / angle)
    return jnp.concatenate([cosine[None], ratio * v])


def logarithm(q: Float[Array, "4"]) -> Float[Array, "3"]:
    """The shortest rotation vector, rad, that `exponential` turns into q or -q; at 180° either of two is."""
    q = normalised(q)
    w, v = jnp.abs(q[0]), jnp.where(q[0] < 0.0, -q[1:], q[1:])
    squared = squared_length(v)
    small = squared < _SMALL * w**2
    length = jnp.sqrt(jnp.where(small, 1.0, squared))
    u = jnp.where(small, squared, 0.0) / jnp.where(small, w, 1.0) ** 2
    series = 2.0 / jnp.where(small, w, 1.0) * (1.0 - u / 3.0 + u**2 / 5.0 - u**3 / 7.0)
    return jnp.where(small, series, 2.0 * jnp.arctan2(length, w) / length) * v


def normalised(q: Float[Array, "4"]) -> Float[Array, "4"]:
    """q of unit length; the identity, without a derivative, for one of no length or one that is not finite."""
    largest = functools.reduce(jnp.maximum, jnp.abs(q))
    sound = jnp.isfinite(largest) & (largest >= jnp.finfo(q.dtype).tiny)
    q = jnp.where(sound, q, jnp.array([1.0, 0.0, 0.0, 0.0], q.dtype))
    # scaled first, for the square of a large number is infinite and that of a small one zero
    q = q / jax.lax.stop_gradient(jnp.where(sound, largest, 1.0))
    return q / jnp.sqrt(squared_length(q))


def squared_length(v: Float[Array, " n"]) -> Float[Array, ""]:
    """v·v, written out: a reduction is a kernel of its own, a sum is part of what is made of it."""
    return functools.reduce(jnp.add, v * v)


def matrix(q: Float[Array, "4"]) -> Float[Array, "3 3"]:
    """R(q) of a quaternion of unit length; its columns are the body's axes in the navigation frame."""
    w, x, y, z = q
    return jnp.stack(
        [
            jnp.stack([w * w + x * x - y * y - z * z, 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)]),
            jnp.stack([2.0 * (x * y + w * z), w * w - x * x + y * y - z * z, 2.0 * (y * z - w * x)]),
            jnp.stack([2.0 * (x * z - w * y), 2.0 * (y * z + w * x), w * w - x * x - y * y + z * z]),
        ]
    )


def euler(q: Float[Array, "4"]) -> Float[Array, "3"]:
    r"""Roll φ, pitch θ in [-90°, 90°] and yaw ψ of q, which need not be of unit length; φ and ψ in (-180°, 180°].

    $\tfrac{\psi-\phi}2 = \arg(w+y,\ z-x)$ and $\tfrac{\psi+\phi}2 = \arg(w-y,\ z+x)$ are angles of two complex numbers,
    of which one vanishes at θ = ±90°; their lengths give the pitch without loss of digits there. In gimbal lock the
    roll is zero, the yaw is all of the turn, and the derivative is that of the angle that remains.
    """
    w, x, y, z = normalised(q)
    upper, first = _polar(w + y, z - x)
    lower, second = _polar(w - y, z + x)
    first, second = jnp.where(upper > 0.0, first, second), jnp.where(lower > 0.0, second, first)
    pitch = 2.0 * jnp.arctan2(upper, lower) - jnp.pi / 2.0
    return jnp.stack([wrapped(second - first), pitch, wrapped(second + first)])


def from_euler(angles: Float[Array, "3"]) -> Float[Array, "4"]:
    """The quaternion of roll, pitch and yaw, rad."""
    c, s = jnp.cos(angles / 2.0), jnp.sin(angles / 2.0)
    return jnp.stack(
        [
            c[0] * c[1] * c[2] + s[0] * s[1] * s[2],
            s[0] * c[1] * c[2] - c[0] * s[1] * s[2],
            c[0] * s[1] * c[2] + s[0] * c[1] * s[2],
            c[0] * c[1] * s[2] - s[0] * s[1] * c[2],
        ]
    )


def turned(q: Float[Array, "4"], heading: Float[Array, ""]) -> Float[Array, "4"]:
    """q with its yaw increased by `heading`, rad: turned about the vertical."""
    return product(from_euler(jnp.zeros(3).at[2].set(heading)), q)


def wrapped(angle: Float[Array, "*k"]) -> Float[Array, "*k"]:
    """The angle less whole turns, in (-π, π]."""
    return angle - 2.0 * jnp.pi * jnp.ceil(angle / (2.0 * jnp.pi) - 0.5)


def length(a: Float[Array, ""], b: Float[Array, ""]) -> Float[Array, ""]:
    """Of [a, b]; zero, without a derivative, where both are zero."""
    squared = a**2 + b**2
    return jnp.where(squared > 0.0, jnp.sqrt(jnp.where(squared > 0.0, squared, 1.0)), 0.0)


def angle(real: Float[Array, ""], imaginary: Float[Array, ""]) -> Float[Array, ""]:
    """Of a complex number, rad; zero, without a derivative, at the origin."""
    origin = (real == 0.0) & (imaginary == 0.0)
    return jnp.where(origin, 0.0, jnp.arctan2(imaginary, jnp.where(origin, 1.0, real)))


def _polar(real: Float[Array, ""], imaginary: Float[Array, ""]) -> tuple[Float[Array, ""], Float[Array, ""]]:
    """Length and angle of a complex number; both zero, without a derivative, where rounding is all that is in it."""
    squared = real**2 + imaginary**2
    vanishes = squared < (8.0 * jnp.finfo(squared.dtype).eps) ** 2
    length = jnp.where(vanishes, 0.0, jnp.sqrt(jnp.where(vanishes, 1.0, squared)))
    return length, jnp.where(vanishes, 0.0, jnp.arctan2(imaginary, jnp.where(vanishes, 1.0, real)))
