r"""The attitude that three satellite fixes and the accelerometers make, the paper's section 2, steps a to g.

The fixes give two velocities, $v_1$ between the first two and $v_2$ between the last two; their mean points along the
track, ψ = atan2(ẏ, ẋ), and their difference is the acceleration $a = (v_2 - v_1)/\tfrac12(t_3 - t_1)$. An
accelerometer shows $f_b = R_x^T(\phi)R_y^T(\theta)R_z^T(\psi)(a - g)$. With $h = R_z^T(\psi)(a - g)$ its first row is

$$f_x = h_x\cos\theta - h_z\sin\theta = r\cos(\theta + \alpha),\quad h_x + ih_z = re^{i\alpha},$$

and with $t_z = h_x\sin\theta + h_z\cos\theta$ the others are $f_y + if_z = (h_y + it_z)e^{-i\phi}$. The first has two
solutions, mirrored in the apparent horizon; the smaller pitch is taken, so that one by which a vehicle would stand
beyond the upright of *apparent* gravity is never found. The track is taken for the heading: sideslip is an error of ψ.

Position, velocity and acceleration are in the navigation frame, north, east, down; g = [0, 0, 9.80665] m/s².
"""

import dataclasses
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.typing import DTypeLike
from jaxtyping import Array, Bool, Float, Int

from ..effects import GRAVITY
from ..filter import select
from .rotation import UNKNOWN, angle, length, wrapped

# the share of the window in which the accelerometer must have been heard
_COVERED = 0.5


@dataclasses.dataclass(frozen=True)
class Limits:
    """Where a construction gives up.

    **Fields**

    - `speed`: m/s over ground below which the track says nothing of the heading.
    - `force`: m/s² below which a specific force or an acceleration has no direction.
    - `span`: s, the longest time from the first fix to the third.
    """

    speed: float = 1.0
    force: float = 1.0
    span: float = 4.0


class Window(NamedTuple):
    """Three fixes and the mean accelerometer reading from the first to the third, in that order of arguments.

    **Fields**

    - `fixes`: (3, 3) m, a fix a row. `times`: (3,) s. `accelerometer`: (3,) m/s², body axes.
    """

    fixes: Float[Array, "*k 3 3"]
    times: Float[Array, "*k 3"]
    accelerometer: Float[Array, "*k 3"]


class ConstructedAttitude(eqx.Module):
    """An attitude, or with leading axes many.

    **Fields**

    - `angles`: (3,) φ, θ, ψ, rad, always finite: those of the middle of the window, `delay` before its last fix.
    - `known`: (3,) which of them may be used.
    - `window`: what they were made of, zero where there was no window.
    """

    angles: Float[Array, "*k 3"]
    known: Bool[Array, "*k 3"]
    window: Window

    @property
    def delay(self) -> Float[Array, " *k"]:
        """The age of the angles when the last fix arrives, s: half of the window, 1 s with a fix a second."""
        return (self.window.times[..., 2] - self.window.times[..., 0]) / 2.0


def constructed_attitude(
    fixes: Float[Array, "3 3"],
    times: Float[Array, "3"],
    accelerometer: Float[Array, "3"],
    heading: Float[Array, ""] | None = None,
    limits: Limits = Limits(),
) -> ConstructedAttitude:
    """The attitude in the middle of a `Window` of three `fixes` (3, 3), m, a row each, at `times` (3,), s.

    `accelerometer` (3,) is its mean reading over the window, m/s². A finite `heading`, rad, of the middle of the window
    replaces the track.

    An angle is unknown, its value then no more than finite, where

    - a number is not finite, a time is not after the one before, or the window is longer than `limits.span`: all three;
    - the vehicle is slower than `limits.speed` and no heading is given: ψ. The others are then found as if there were
      no horizontal acceleration, and where there is more of it than `limits.force` they are unknown too;
    - r is below `limits.force`, as in free fall, or |f_x| above r, or no pitch within ±90° solves it: θ and φ;
    - f_y + i f_z or h_y + i t_z is below `limits.force`, the vehicle hanging from its nose or tail: φ.
    """
    window = Window(fixes, times, accelerometer)
    velocity, across, forces, sound = _motion(window, limits)
    course, has_heading = _course(velocity, heading, limits)
    # without a heading the direction of a horizontal acceleration in the body is not known
    sideways = jnp.where(has_heading, across[:2], 0.0)
    has_level = sound & (has_heading | (length(*across[:2]) < limits.force))
    ahead = jnp.cos(course) * sideways[0] + jnp.sin(course) * sideways[1]
    abeam = jnp.cos(course) * sideways[1] - jnp.sin(course) * sideways[0]
    below = across[2] - GRAVITY
    pitch, has_pitch = _pitch(ahead, below, forces[0], limits)
    roll, has_roll = _roll(abeam, ahead * jnp.sin(pitch) + below * jnp.cos(pitch), forces, limits)
    known = jnp.stack([has_level & has_pitch & has_roll, has_level & has_pitch, sound & has_heading])
    return ConstructedAttitude(jnp.stack([roll, pitch, course]), known, window)


def standard_deviations(
    fixes: Float[Array, "3 3"],
    times: Float[Array, "3"],
    accelerometer: Float[Array, "3"],
    position_std: Float[Array, "3"],
    accelerometer_std: Float[Array, "3"],
    heading: Float[Array, ""] | None = None,
    heading_std: Float[Array, ""] | float = 0.0,
    limits: Limits = Limits(),
) -> Float[Array, "3"]:
    r"""Standard deviations of φ, θ, ψ, rad, to first order: roots of the diagonal of $J\Sigma J^T$.

    `fixes`, `times`, `accelerometer`, `heading` and `limits` are as of `constructed_attitude`. `position_std` (3,) is
    of what differs from fix to fix, m, since an error common to the three fixes drops out; `accelerometer_std` (3,) of
    the mean over the window, m/s², bias included; `heading_std` of a given heading, rad. An unknown angle has π/√3, the
    deviation of one that may be anything, and no angle has more.
    """
    course = jnp.zeros((), fixes.dtype) if heading is None else heading

    def angles(fixes: Array, accelerometer: Array, course: Array) -> tuple[Array, Array]:
        found = constructed_attitude(fixes, times, accelerometer, None if heading is None else course, limits)
        return found.angles, found.known

    J, known = jax.jacfwd(angles, argnums=(0, 1, 2), has_aux=True)(fixes, accelerometer, course)
    spread = (J[0] * position_std).reshape(3, -1), J[1] * accelerometer_std, (J[2] * heading_std)[:, None]
    variance = jnp.sum(jnp.concatenate(spread, axis=1) ** 2, axis=1)
    # the comparison is false for a variance that overflowed to NaN
    bounded = known & (variance < UNKNOWN**2)
    return jnp.where(bounded, jnp.sqrt(jnp.where(bounded, variance, 1.0)), UNKNOWN)


class ConstructedAttitudeStream(eqx.Module):
    r"""What a flight loop keeps between samples: the last two fixes and the accelerometer's integral since each.

    The mean reading is the integral of straight lines between samples, over the time in which there were any, so that
    uneven sampling does not bias it.

    **Fields**

    - `time`: s, of the last sample, and `accelerometer`: (3,) m/s², its reading; `sound`: whether that was finite.
    - `started`: whether any sample came.
    - `fixes`: (2, 3) m and `times`: (2,) s of the last two fixes; `count`: how many of them are there.
    - `integral`: (2, 3) m/s of the accelerometer's readings between those fixes and since the last; `covered`: (2,) s
      of these intervals in which it was heard.
    - `limits`: where a construction gives up.
    """

    time: Float[Array, ""]
    accelerometer: Float[Array, "3"]
    sound: Bool[Array, ""]
    started: Bool[Array, ""]
    fixes: Float[Array, "2 3"]
    times: Float[Array, "2"]
    count: Int[Array, ""]
    integral: Float[Array, "2 3"]
    covered: Float[Array, "2"]
    limits: Limits = eqx.field(static=True)

    @classmethod
    def start(cls, limits: Limits = Limits(), dtype: DTypeLike | None = None) -> "ConstructedAttitudeStream":
        """Before the first sample; `limits` are as of `constructed_attitude`.

        `dtype` is that of the samples, by default JAX's own.
        """
        zeros = lambda *shape: jnp.zeros(shape, dtype)
        no, none = jnp.zeros((), bool), jnp.zeros((), jnp.int32)
        return cls(zeros(), zeros(3), no, no, zeros(2, 3), zeros(2), none, zeros(2, 3), zeros(2), limits)

    def step(
        self,
        time: Float[Array, ""],
        accelerometer: Float[Array, "3"],
        fix: Float[Array, "3"],
        present: Bool[Array, ""],
        heading: Float[Array, ""] | None = None,
    ) -> "tuple[ConstructedAttitudeStream, ConstructedAttitude]":
        """The next state, and the attitude if a fix is `present` and the third of a window; else nothing is known.

        A sample without a finite time is passed over, a reading or fix that is not finite is as one that is missing, a
        second fix at one time is ignored, and a time that goes back starts anew. Of a window the accelerometer must
        have been heard for half. The fix is one of the sample's time; `heading` is as in `constructed_attitude`.
        """
        timed = jnp.isfinite(time)
        time = jnp.where(timed, time, self.time)
        back = self.started & (time < self.time)
        fresh = ConstructedAttitudeStream.start(self.limits, self.time.dtype)
        heard = select(back, fresh, self)._hear(time, accelerometer)
        arrives = timed & present & jnp.all(jnp.isfinite(fix)) & ((heard.count == 0) | (time > heard.times[1]))
        after = select(arrives, heard._receive(time, fix), heard)
        found = heard._construct(time, fix, arrives & (heard.count == 2), heading)
        return select(timed, after, self), found

    def _hear(self, time: Array, accelerometer: Array) -> "ConstructedAttitudeStream":
        sound = jnp.all(jnp.isfinite(accelerometer))
        reading = jnp.where(sound, accelerometer, 0.0)
        elapsed = jnp.where(self.sound & sound, time - self.time, 0.0)
        step = elapsed * (self.accelerometer + reading) / 2.0
        return dataclasses.replace(
            self,
            time=time,
            accelerometer=reading,
            sound=sound,
            started=jnp.ones((), bool),
            integral=self.integral.at[1].add(step),
            covered=self.covered.at[1].add(elapsed),
        )

    def _receive(self, time: Array, fix: Array) -> "ConstructedAttitudeStream":
        return dataclasses.replace(
            self,
            fixes=jnp.stack([self.fixes[1], fix]),
            times=jnp.stack([self.times[1], time]),
            count=jnp.minimum(self.count + 1, 2),
            integral=jnp.stack([self.integral[1], jnp.zeros_like(self.integral[1])]),
            covered=jnp.stack([self.covered[1], jnp.zeros_like(self.covered[1])]),
        )

    def _construct(self, time: Array, fix: Array, complete: Array, heading: Array | None) -> ConstructedAttitude:
        covered = jnp.sum(self.covered)
        complete &= covered > _COVERED * (time - self.times[0])
        mean = jnp.sum(self.integral, axis=0) / jnp.where(complete, covered, 1.0)
        whole = Window(jnp.concatenate([self.fixes, fix[None]]), jnp.append(self.times, time), mean)
        # nothing is known of an empty window, whose times do not increase
        window = jax.tree.map(lambda part: jnp.where(complete, part, 0.0), whole)
        return constructed_attitude(*window, heading=heading, limits=self.limits)


def constructed_over(
    times: Float[Array, " k"],
    accelerometer: Float[Array, "k 3"],
    fixes: Float[Array, "k 3"],
    present: Bool[Array, " k"],
    heading: Float[Array, " k"] | None = None,
    limits: Limits = Limits(),
) -> ConstructedAttitude:
    """The attitudes along a recording, (K,) of them, known where a third fix arrives: `step` scanned.

    `times` (K,) are s, `accelerometer` (K, 3) m/s² and `fixes` (K, 3) m, a row a sample, of which those `present` (K,)
    count; a `heading` (K,), rad, at a fix is that of the middle of the window which the fix ends. `limits` are as of
    `constructed_attitude`.
    """
    stream = ConstructedAttitudeStream.start(limits, accelerometer.dtype)
    samples = times, accelerometer, fixes, present, heading
    return jax.lax.scan(lambda state, sample: state.step(*sample), stream, samples)[1]


def _motion(window: Window, limits: Limits) -> tuple[Array, Array, Array, Array]:
    """Mean velocity, acceleration, specific force, and whether these can be trusted; else those of level rest."""
    fixes, times, forces = window
    finite = jnp.stack([jnp.all(jnp.isfinite(part)) for part in window]).all()
    timed = finite & jnp.all(jnp.diff(times) > 0.0) & (times[2] - times[0] <= limits.span)
    elapsed = jnp.where(timed, jnp.diff(times), 1.0)
    velocity = jnp.diff(jnp.where(timed, fixes, 0.0), axis=0) / elapsed[:, None]
    acceleration = (velocity[1] - velocity[0]) / (jnp.sum(elapsed) / 2.0)
    # finite numbers may be too large or too close in time
    sound = timed & jnp.all(jnp.isfinite(acceleration))
    level = jnp.array([0.0, 0.0, -GRAVITY], fixes.dtype)
    chosen = jnp.where(sound, jnp.stack([jnp.mean(velocity, axis=0), acceleration]), 0.0)
    return chosen[0], chosen[1], jnp.where(sound, forces, level), sound


def _course(velocity: Array, heading: Array | None, limits: Limits) -> tuple[Array, Array]:
    moving = length(velocity[0], velocity[1]) >= limits.speed
    track = angle(velocity[0], velocity[1])
    if heading is None:
        return track, moving
    given = jnp.isfinite(heading)
    return wrapped(jnp.where(given, heading, track)), given | moving


def _pitch(ahead: Array, below: Array, force: Array, limits: Limits) -> tuple[Array, Array]:
    r = length(ahead, below)
    ratio = force / jnp.where(r > 0.0, r, 1.0)
    inside = jnp.abs(ratio) < 1.0
    cosine = jnp.where(inside, ratio, jnp.sign(ratio))
    sine = jnp.where(inside, jnp.sqrt(jnp.where(inside, 1.0 - cosine**2, 1.0)), 0.0)
    # falling faster than gravity pulls turns the apparent vertical over, and with it the branch of the smaller pitch
    sense = jnp.where(below > 0.0, -1.0, 1.0)
    pitch = wrapped(-angle(ahead, below) - sense * jnp.arctan2(sine, cosine))
    steepest = jnp.pi / 2.0
    return jnp.clip(pitch, -steepest, steepest), inside & (r >= limits.force) & (jnp.abs(pitch) <= steepest)


def _roll(abeam: Array, below: Array, forces: Array, limits: Limits) -> tuple[Array, Array]:
    known = jnp.minimum(length(abeam, below), length(forces[1], forces[2])) >= limits.force
    return wrapped(angle(abeam, below) - angle(forces[1], forces[2])), known
