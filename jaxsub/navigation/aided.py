r"""Strapdown navigation aided by any set of sensors, with scale errors and delays among its states.

State: $[q, v, p, b_g, b_a, S, \tau]$, the strapdown state, the gyros' scale errors and misalignments, and one delay for
each sensor that has one to be estimated. $\omega = (I - S)\,\tilde\omega - b_g$. Source: Groves (2013), §4.4 and §14.
"""

import abc
import dataclasses
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..arrays import Values
from ..filter import AbstractProcess, Sample
from .alignment import MagneticField
from .rotation import euler, exponential, matrix, normalised, product, wrapped
from .strapdown import Inertial, StrapdownNavigation, field_heading

# states of the strapdown navigation and of the gyros' matrix, and ways to change
STRAPDOWN, SCALES = 16, 9
# columns of the matrix in the order of its states: scale errors of x, y, z, then misalignments xy, xz, yx, yz, zx, zy
_COLUMNS = np.array([0, 1, 2, 1, 2, 0, 2, 0, 1])
CHANGES = STRAPDOWN - 1 + SCALES


class AidedInputs(eqx.Module):
    """What drives the navigation in the interval before a sample, body axes.

    **Fields**

    - `inertial`: readings. `rate_std`: (3,) rad/s and `force_std`: (3,) m/s², by which they may be wrong all through
      the interval; zero where the sensors read as they should.
    """

    inertial: Inertial
    rate_std: Float[Array, "*k 3"]
    force_std: Float[Array, "*k 3"]


class Kinematics(NamedTuple):
    """A motion at one moment: `q`, R(q), velocity and position NED, rate and specific force in body axes."""

    q: Float[Array, "4"]
    R: Float[Array, "3 3"]
    velocity: Float[Array, "3"]
    position: Float[Array, "3"]
    rate: Float[Array, "3"]
    acceleration: Float[Array, "3"]
    magnetometer: Float[Array, "3"]


class AbstractAid(eqx.Module):
    """A sensor beside the inertial ones.

    **Fields**

    - `delay`: number of its delay among the states, -1 where it has none to be estimated.
    """

    delay: eqx.AbstractVar[int]

    @abc.abstractmethod
    def shown(self, motion: Kinematics) -> Float[Array, " c"]:
        """What it shows of a motion."""


class PositionAid(AbstractAid):
    """$p + R\\,l$, the components `rows` of it."""

    lever_arm: Float[Array, "3"]
    rows: tuple[int, ...] = eqx.field(static=True)
    delay: int = eqx.field(static=True)

    def shown(self, motion: Kinematics) -> Float[Array, " c"]:
        """North, east, down, m."""
        return (motion.position + motion.R @ self.lever_arm)[np.array(self.rows)]


class VelocityAid(AbstractAid):
    r"""$v + R\,(\omega\times l)$, the components `rows` of it."""

    lever_arm: Float[Array, "3"]
    rows: tuple[int, ...] = eqx.field(static=True)
    delay: int = eqx.field(static=True)

    def shown(self, motion: Kinematics) -> Float[Array, " c"]:
        """North, east, down, m/s."""
        return (motion.velocity + motion.R @ jnp.cross(motion.rate, self.lever_arm))[np.array(self.rows)]


class BodyVelocityAid(AbstractAid):
    r"""$R^Tv + \omega\times l$, a Doppler log's."""

    lever_arm: Float[Array, "3"]
    delay: int = eqx.field(static=True)

    def shown(self, motion: Kinematics) -> Float[Array, " c"]:
        """Forward, starboard, down, m/s."""
        return motion.R.T @ motion.velocity + jnp.cross(motion.rate, self.lever_arm)


class RangeAid(AbstractAid):
    """$|p + R\\,l - b|$, the distance from a beacon at b, m NED."""

    lever_arm: Float[Array, "3"]
    beacon: Float[Array, "3"]
    delay: int = eqx.field(static=True)

    def shown(self, motion: Kinematics) -> Float[Array, " c"]:
        """One distance, m."""
        away = motion.position + motion.R @ self.lever_arm - self.beacon
        return jnp.sqrt(jnp.maximum(jnp.sum(away**2), 1e-6))[None]


class CompassAid(AbstractAid):
    """The heading ψ."""

    delay: int = eqx.field(static=True)

    def shown(self, motion: Kinematics) -> Float[Array, " c"]:
        """One angle, rad."""
        return euler(motion.q)[2:]


class MagneticAid(AbstractAid):
    """Minus the heading of the field in terms of its standard deviation, of which zero is measured."""

    field: MagneticField
    delay: int = eqx.field(static=True)

    def shown(self, motion: Kinematics) -> Float[Array, " c"]:
        """One number."""
        return -field_heading(motion.R, motion.magnetometer, self.field)[None]


class AidedNavigation(AbstractProcess):
    """Strapdown navigation with what `aids` show, one after the other, as channels.

    **Fields**

    - `inertial`: the strapdown process. `aids`: in the order of their channels. `delays`: how many are states.
    """

    inertial: StrapdownNavigation
    aids: tuple[AbstractAid, ...]
    delays: int = eqx.field(static=True, default=0)

    def moved(self, x: Float[Array, " n"], change: Float[Array, " s"]) -> Float[Array, " n"]:
        """The attitude turned, the rest added."""
        inner = self.inertial.moved(x[:STRAPDOWN], change[: STRAPDOWN - 1])
        return jnp.concatenate([inner, x[STRAPDOWN:] + change[STRAPDOWN - 1 :]])

    def difference(self, x: Float[Array, " n"], origin: Float[Array, " n"]) -> Float[Array, " s"]:
        """The rotation between the two, and the differences of the rest."""
        inner = self.inertial.difference(x[:STRAPDOWN], origin[:STRAPDOWN])
        return jnp.concatenate([inner, x[STRAPDOWN:] - origin[STRAPDOWN:]])

    def step(self, x: Float[Array, " n"], theta: Float[Array, " p"], sample: Sample) -> Float[Array, " n"]:
        """The strapdown step with the gyros' matrix taken off; that and the delays stay."""
        inner = self.inertial.step(x[:STRAPDOWN], theta, _scaled(x, sample))
        return jnp.concatenate([inner, x[STRAPDOWN:]])

    def driven(
        self, x: Float[Array, " n"], theta: Float[Array, " p"], sample: Sample, root: Float[Array, "s m"]
    ) -> Float[Array, "s k"]:
        """The rule's noise, that of the inertial sensors, and what is unknown where these do not read as they should.

        An error that lasts through the interval turns by itself times the interval.
        """
        inner = _scaled(x, sample)
        R, T = matrix(normalised(x[:4])), sample.elapsed
        # what a scale error makes of gravity is a bias; what it makes of a motion varies with that
        moving = inner.inputs.accelerometer + R.T @ self.inertial.gravity(x.dtype)
        read = Inertial(inner.inputs.gyro, moving, inner.inputs.magnetometer)
        inner = dataclasses.replace(inner, inputs=read)
        own = self.inertial.driven(x[:STRAPDOWN], theta, inner, jnp.zeros((STRAPDOWN - 1, 0), x.dtype))
        lost = jnp.zeros((STRAPDOWN - 1, 6), x.dtype).at[:3, :3].set(R * sample.inputs.rate_std * T)
        lost = lost.at[3:6, 3:].set(R * sample.inputs.force_std * T)
        whole = jnp.concatenate([own, lost], axis=1)
        below = jnp.zeros((len(root) - len(whole), whole.shape[1]), x.dtype)
        return jnp.concatenate([root, jnp.concatenate([whole, below])], axis=1)

    def observe(self, x: Float[Array, " n"], theta: Float[Array, " p"], sample: Sample) -> Float[Array, " c"]:
        """What each sensor shows of the motion as it was its delay ago."""
        motion = kinematics(self.inertial, x, sample)
        late = x[STRAPDOWN + SCALES :]
        of = lambda aid: aid.shown(motion if aid.delay < 0 else earlier(motion, late[aid.delay]))
        return jnp.concatenate([of(aid) for aid in self.aids] or [jnp.zeros(0, x.dtype)])

    def innovation(self, measured: Float[Array, " c"], expected: Float[Array, " c"]) -> Float[Array, " c"]:
        """The difference, of a compass by the shorter way."""
        difference = measured - expected
        turns = [isinstance(aid, CompassAid) for aid in self.aids for _ in range(channel_count(aid))]
        return jnp.where(np.array(turns, bool), wrapped(difference), difference)


def channel_count(aid: AbstractAid) -> int:
    """How many numbers an aid shows."""
    if isinstance(aid, PositionAid | VelocityAid):
        return len(aid.rows)
    return 3 if isinstance(aid, BodyVelocityAid) else 1


def blocks(aids: Sequence[AbstractAid]) -> list[slice]:
    """Where the channels of each aid stand."""
    ends = np.cumsum([0, *(channel_count(aid) for aid in aids)]).tolist()
    return [slice(first, last) for first, last in pairwise(ends)]


def kinematics(process: StrapdownNavigation, x: Float[Array, " n"], sample: Sample) -> Kinematics:
    """The motion at a sample."""
    read = _scaled(x, sample).inputs
    R = matrix(x[:4])
    rate = read.gyro - x[10:13]
    gravity = process.gravity(x.dtype)
    return Kinematics(x[:4], R, x[4:7], x[7:10], rate, R @ (read.accelerometer - x[13:16]) + gravity, read.magnetometer)


def earlier(motion: Kinematics, delay: Float[Array, ""]) -> Kinematics:
    """The motion as it was `delay` seconds before, its rate and acceleration taken as constant."""
    q = product(motion.q, exponential(-delay * motion.rate))
    position = motion.position - delay * motion.velocity + 0.5 * delay**2 * motion.acceleration
    velocity = motion.velocity - delay * motion.acceleration
    return motion._replace(q=q, R=matrix(q), velocity=velocity, position=position)


def scaled_rate(x: Float[Array, " n"], gyro: Float[Array, "3"]) -> Float[Array, "3"]:
    """$(I - S)$ times the gyros' reading, rad/s: without scale errors and misalignments, with the bias."""
    return gyro - by_matrix(x[STRAPDOWN : STRAPDOWN + SCALES], gyro)


def by_matrix(states: Float[Values, "*k 9"], rate: Float[Values, "*k 3"]) -> Float[Values, "*k 3"]:
    r"""$S\tilde\omega$ of the states of S and the gyros' reading, rad/s, of JAX or NumPy."""
    parts = states * rate[..., _COLUMNS]
    return parts[..., :3] + parts[..., 3::2] + parts[..., 4::2]


def _scaled(x: Float[Array, " n"], sample: Sample) -> Sample:
    """The sample for the strapdown process, what the gyros' matrix makes of the rates taken off."""
    read = sample.inputs.inertial
    gyro = scaled_rate(x, read.gyro)
    inertial = Inertial(gyro, read.accelerometer, read.magnetometer)
    return Sample(inertial, sample.elapsed, sample.outputs, sample.mask, sample.scale)
