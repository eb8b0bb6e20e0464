"""The attitude of a body that is held still, from what its accelerometers and magnetometers show on average.

The accelerometers show the vertical, $d = -f/|f|$ in body axes, and with it roll and pitch; the field then shows the
heading. Source: Titterton and Weston (2004), §10.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from .rotation import UNKNOWN, angle, from_euler, length, matrix

# m/s² below which a specific force has no direction
_LEAST_FORCE = 1.0
# the share of the field that must be horizontal; with less of it, dip above 87°, a small disturbance turns it anywhere
_LEAST_SHARE = 0.05


class MagneticField(eqx.Module):
    r"""Earth's field as it should be, in the magnetometer's unit.

    Something that disturbs it by a component turned away from magnetic north spoils the heading, and nothing shows how
    large that component is. The other two are seen: how far the horizontal and the downward part are from what they
    should be, together $d$. A disturbance of no preferred direction is expected to have $d^2/2$ in the third.

    **Fields**

    - `horizontal`, `down`: its parts, in that unit. `spread`: standard deviation of each component from place
      to place, in that unit.
    """

    horizontal: Float[Array, ""] | float
    down: Float[Array, ""] | float
    spread: Float[Array, ""] | float

    def heading_std(self, seen: Float[Array, "3"]) -> Float[Array, ""]:
        r"""$\sqrt{\sigma^2 + d^2/2}$ over the horizontal part of the field `seen`, north, east, down; at most π/√3."""
        horizontal = length(seen[0], seen[1])
        squared = (horizontal - self.horizontal) ** 2 + (seen[2] - self.down) ** 2
        wide = jnp.sqrt(self.spread**2 + squared / 2.0)
        known = wide < UNKNOWN * horizontal
        return jnp.where(known, wide / jnp.where(known, horizontal, 1.0), UNKNOWN)


class Alignment(eqx.Module):
    """An attitude found at rest.

    **Fields**

    - `q`: (4,) always of unit length. What is unknown of it is zero: the heading, or all three angles.
    - `level`: whether roll and pitch are known; `heading`: whether the heading is.
    - `field`: (3,) the magnetometer's reading in level axes, of which the first points to magnetic north if known.
    """

    q: Float[Array, "4"]
    level: Bool[Array, ""]
    heading: Bool[Array, ""]
    field: Float[Array, "3"]

    def deviations(self, tilt: float, heading: float) -> Float[Array, "3"]:
        """Standard deviations (3,), rad, of the attitude's error about north, east, down.

        Those are `tilt` and `heading`, rad, where known, else π/√3.
        """
        known = jnp.stack([self.level, self.level, self.heading])
        return jnp.where(known, jnp.array([tilt, tilt, heading], self.q.dtype), UNKNOWN)


def aligned(accelerometer: Float[Array, "3"], magnetometer: Float[Array, "3"]) -> Alignment:
    """The attitude at rest by mean readings of `accelerometer` (3,), m/s², and `magnetometer` (3,), any unit.

    In free fall, or where a reading is not finite, nothing is known; without a field, or where it is vertical, all but
    the heading is. Nose or tail up, roll is zero and the yaw is all of the turn. Heading is magnetic.
    """
    level = jnp.all(jnp.isfinite(accelerometer)) & (_norm(accelerometer) >= _LEAST_FORCE)
    down = jnp.where(level, -accelerometer, jnp.array([0.0, 0.0, 1.0], accelerometer.dtype))
    roll = angle(down[2], down[1])
    pitch = angle(length(down[1], down[2]), -down[0])
    seen = jnp.where(jnp.all(jnp.isfinite(magnetometer)), magnetometer, 0.0)
    field = matrix(from_euler(jnp.stack([roll, pitch, jnp.zeros_like(roll)]))) @ seen
    horizontal = length(field[0], field[1])
    heading = level & (horizontal > _LEAST_SHARE * _norm(seen))
    yaw = jnp.where(heading, -angle(field[0], field[1]), 0.0)
    north = jnp.stack([horizontal, jnp.zeros_like(horizontal), field[2]])
    return Alignment(from_euler(jnp.stack([roll, pitch, yaw])), level, heading, jnp.where(heading, north, field))


def _norm(v: Array) -> Array:
    return length(length(v[0], v[1]), v[2])
