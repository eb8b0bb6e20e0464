"""The paper's whole navigator: constructed attitude, attitude filter and position filter, one after the other."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from ..filter import AbstractFilter, Estimate, FilterState
from ..methods import jittable
from .attitude import Gyro
from .constructed import ConstructedAttitude, ConstructedAttitudeStream, Limits, standard_deviations
from .position import Course
from .rotation import conjugate, logarithm, product
from .stream import AbstractStream, Reading, Stream, StreamState


class FlightReading(eqx.Module):
    """What the paper's sensors show at a time, or with leading axes many.

    **Fields**

    - `time`: s. `gyro`: (3,) rad/s and `accelerometer`: (3,) m/s², body axes. `speed`: m/s along the body's x axis.
    - `fix`: (3,) m, north, east, down; `present`: whether there is one.
    """

    time: Float[Array, " *k"]
    gyro: Float[Array, "*k 3"]
    accelerometer: Float[Array, "*k 3"]
    speed: Float[Array, " *k"]
    fix: Float[Array, "*k 3"]
    present: Bool[Array, " *k"]


class NavigatorState(eqx.Module):
    """What the navigator carries from reading to reading; what was wrong with readings is in the `faults` of two.

    **Fields**

    - `construction`: fixes and accelerometer. `attitude`, `position`: of its streams.
    """

    construction: ConstructedAttitudeStream
    attitude: StreamState
    position: StreamState


class Navigated(eqx.Module):
    """What the navigator knows after a reading.

    **Fields**

    - `attitude`, `position`: of its filters. `constructed`: what the attitude was measured to be, where `known`.
    """

    attitude: Estimate
    position: Estimate
    constructed: ConstructedAttitude


class PaperNavigator(AbstractStream):
    r"""Three fixes and the accelerometer make an attitude that corrects that of the gyros; it steers dead reckoning.

    A filter steps at every reading and corrects where a fix comes: with one in each fourth reading that is the paper's
    schedule. The constructed attitude is that of half a window ago and is taken, as in the paper, for the present one.

    **Fields**

    - `attitude`: a stream of `PaperAttitude` or `RotationAttitude`. `position`: one of `DeadReckoning`.
    - `position_std`: (3,) m and `accelerometer_std`: (3,) m/s², as in `standard_deviations`.
    - `limits`: where the construction gives up.
    """

    attitude: Stream
    position: Stream
    position_std: Float[Array, "3"]
    accelerometer_std: Float[Array, "3"]
    limits: Limits = eqx.field(static=True, default=Limits())

    def start(self, attitude: FilterState, position: FilterState, like: FlightReading) -> NavigatorState:
        """Before the first reading, from states of the filters of `attitude` and `position`.

        Readings will have the type of `like`.
        """
        angles, none = jnp.zeros_like(like.gyro), jnp.zeros(3, bool)
        seen = Reading(like.time, Gyro(like.gyro), angles, none, jnp.ones_like(angles))
        course = Course(like.speed, attitude.x[:4], angles)
        return NavigatorState(
            ConstructedAttitudeStream.start(self.limits, like.fix.dtype),
            self.attitude.start(attitude, seen),
            self.position.start(position, Reading(like.time, course, angles, none)),
        )

    @jittable
    def step(self, state: NavigatorState, reading: FlightReading) -> tuple[NavigatorState, Navigated]:
        """The next state and what is known after `reading`."""
        tick = state.attitude.clock.tick(reading.time, self.attitude.patience)
        # what the streams pass over, the construction does when it has no time
        time = jnp.where(tick.passed, jnp.nan, reading.time)
        construction, found = state.construction.step(time, reading.accelerometer, reading.fix, reading.present)
        seen = Reading(reading.time, Gyro(reading.gyro), found.angles, found.known, self._scale(found))
        attitude, turned = self.attitude.step(state.attitude, seen)
        course = Course(reading.speed, turned.x[:4], _rotation_std(self.attitude.filter, attitude.filter))
        fixed = Reading(reading.time, course, reading.fix, jnp.broadcast_to(reading.present, 3))
        position, moved = self.position.step(state.position, fixed)
        return NavigatorState(construction, attitude, position), Navigated(turned, moved, found)

    def _scale(self, found: ConstructedAttitude) -> Float[Array, "3"]:
        """The constructed angles' noise in terms of what the attitude filter assumes."""
        assumed = jnp.linalg.norm(self.attitude.filter.R_root, axis=1)
        std = lambda: standard_deviations(*found.window, self.position_std, self.accelerometer_std, limits=self.limits)
        # most readings bring no fix
        return jax.lax.cond(jnp.any(found.known), std, lambda: assumed) / assumed


def _rotation_std(filter: AbstractFilter, state: FilterState) -> Float[Array, "3"]:
    """Standard deviations of the attitude's rotation about the body's axes, rad."""
    turn = lambda change: logarithm(product(conjugate(state.x[:4]), filter.process.moved(state.x, change)[:4]))
    by_change = jax.jacfwd(turn)(jnp.zeros(len(filter.x_root), state.x.dtype))
    return jnp.sqrt(jnp.maximum(jnp.diag(filter.form.seen(state.joint, by_change)), 0.0))
