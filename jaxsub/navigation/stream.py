"""A filter in a flight loop: readings with time stamps in, estimates out, whatever the readings are like.

On-line `Stream.step` takes a reading at a time, best compiled by `ahead_of_time`; off-line `follow` scans the same
step over a recording, and `jax.vmap` of it over many. Nothing a reading holds makes the state anything but finite, and
what was wrong with readings is counted.
"""

import abc
import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PyTree

from ..filter import AbstractFilter, AbstractGate, Estimate, FilterState, InnovationGate, Open, Sample, select
from ..methods import jittable
from ..programs import compiled


class Reading(eqx.Module):
    """What sensors show at a time, or with leading axes many.

    **Fields**

    - `time`: s, of one clock. In 32 bits it is rounded to 0.12 ms after half an hour, to 8 ms after a day.
    - `inputs`: what drove the process since the reading before, SI.
    - `outputs`: (c,) measured channels, SI; `mask`: (c,) true where measured.
    - `scale`: (c,) noise of the channels relative to what the filter assumes; by default one.
    """

    time: Float[Array, " *k"]
    inputs: PyTree[Array]
    outputs: Float[Array, "*k c"]
    mask: Bool[Array, "*k c"]
    scale: Float[Array, "*k c"] | None = None


class Faults(eqx.Module):
    """How many readings, or of each channel how many measurements, were not as they should be.

    **Fields**

    - `untimed`: without a finite time, passed over. `behind`: earlier than one before, passed over.
    - `restarts`: earlier, after so many others that the clock was taken to have been set back; no time passed.
    - `duplicates`: of the time of the one before: no time passed. `gaps`: later than `Stream.longest` allows.
    - `inputs`: with inputs that were not finite; the last finite ones were used.
    - `saturated`: with an input at its range.
    - `outputs`: (c,) measured, but the number or its scale was not finite, or the scale not positive; left out.
    - `repeated`: (c,) measured already at that time; left out.
    - `rejected`: (c,) outside the gate; left out. `recoveries`: (c,) measured when the gate's patience was used up: the
      channel was believed again, by a state as uncertain as at the start. The state was wrong before that, or is now.
    - `broken`: that would have left numbers in the filter that are not finite, passed over.
    """

    untimed: Int[Array, " *k"]
    behind: Int[Array, " *k"]
    restarts: Int[Array, " *k"]
    duplicates: Int[Array, " *k"]
    gaps: Int[Array, " *k"]
    inputs: Int[Array, " *k"]
    saturated: Int[Array, " *k"]
    outputs: Int[Array, "*k c"]
    repeated: Int[Array, "*k c"]
    rejected: Int[Array, "*k c"]
    recoveries: Int[Array, "*k c"]
    broken: Int[Array, " *k"]

    @classmethod
    def none(cls, channels: int) -> "Faults":
        """Nothing was wrong yet, on so many `channels`."""
        zero, each = jnp.zeros((), jnp.int32), jnp.zeros(channels, jnp.int32)
        return cls(zero, zero, zero, zero, zero, zero, zero, each, each, each, each, zero)

    def plus(self, **found: Bool[Array, "..."]) -> "Faults":
        """With those that were `found`."""
        return dataclasses.replace(self, **{n: getattr(self, n) + more.astype(jnp.int32) for n, more in found.items()})


class Tick(eqx.Module):
    """What a time stamp says.

    **Fields**

    - `elapsed`: s since the reading before, zero for the first and where passed over.
    - `passed`: whether the reading is to be passed over, since it is `untimed` or `behind`.
    - `restarts`, `duplicate`: as in `Faults`.
    """

    elapsed: Float[Array, ""]
    passed: Bool[Array, ""]
    untimed: Bool[Array, ""]
    behind: Bool[Array, ""]
    restarts: Bool[Array, ""]
    duplicate: Bool[Array, ""]


class Clock(eqx.Module):
    """The time of the last reading that was not passed over.

    **Fields**

    - `time`: s. `started`: whether there was any. `behind`: how many readings in a row were earlier.
    """

    time: Float[Array, ""]
    started: Bool[Array, ""]
    behind: Int[Array, ""]

    def tick(self, time: Float[Array, ""], patience: int) -> Tick:
        """`time` judged; a clock that has been earlier `patience` readings in a row has been set back."""
        timed = jnp.isfinite(time)
        earlier = timed & self.started & (time < self.time)
        restarts = earlier & (self.behind >= patience)
        behind = earlier & ~restarts
        later = timed & self.started & (time > self.time)
        elapsed = jnp.where(later, time - self.time, 0.0)
        return Tick(elapsed, ~timed | behind, ~timed, behind, restarts, timed & self.started & (time == self.time))


class AbstractStream(eqx.Module):
    """Takes a reading at a time."""

    @abc.abstractmethod
    def step(self, state: Any, reading: Any) -> tuple[Any, Any]:
        """The next state and what is known after `reading`."""


class StreamState(eqx.Module):
    """What a stream carries from reading to reading.

    **Fields**

    - `filter`: its filter's state. `clock`: the last time. `inputs`: the last good ones, SI.
    - `taken`: (c,) channels measured at the last time. `faults`: counted since the start.
    """

    filter: FilterState
    clock: Clock
    inputs: PyTree[Array]
    taken: Bool[Array, " c"]
    faults: Faults


class Stream(AbstractStream):
    """`filter` on readings with time stamps.

    **Fields**

    - `ranges`: inputs at whose magnitude a sensor is at its stop, shaped like a reading's; by default none is. That is
      counted only; to mistrust such a sensor is up to the process.
    - `longest`: s, above it the time between two readings is a gap, across which the later one's inputs hold.
    - `patience`: readings in a row that may be earlier than one before, until the clock is taken to have been set back.
    - `gate`: which measurements are believed; by default the filter's gate, or where that believes everything
      `InnovationGate.of` its channels, which refuses one in a million that are consistent. `Open()` believes all.
    """

    filter: AbstractFilter
    ranges: PyTree | None = None
    longest: float = eqx.field(static=True, default=1.0)
    patience: int = eqx.field(static=True, default=10)
    gate: AbstractGate | None = None

    def _gated(self) -> AbstractFilter:
        """The filter with the stream's gate."""
        if self.gate is None and not isinstance(self.filter.gate, Open):
            return self.filter
        R_root = self.filter.R_root
        gate = self.gate or InnovationGate.of(len(R_root), dtype=R_root.dtype)
        return eqx.tree_at(lambda filter: filter.gate, self.filter, gate)

    def start(self, state: FilterState, like: Reading) -> StreamState:
        """Before the first reading, from `state`; readings will have the shapes of `like`, which may be the first.

        Its inputs are held until finite ones come; those that are not finite count as zero.
        """
        inputs = jax.tree.map(lambda leaf: jnp.where(jnp.isfinite(leaf), leaf, jnp.zeros_like(leaf)), like.inputs)
        clock = Clock(jnp.zeros_like(like.time), jnp.zeros((), bool), jnp.zeros((), jnp.int32))
        return StreamState(state, clock, inputs, jnp.zeros(like.mask.shape, bool), Faults.none(like.mask.size))

    @jittable
    def step(self, state: StreamState, reading: Reading) -> tuple[StreamState, Estimate]:
        """The next state and what is known after `reading`; for one passed over, what was known before."""
        tick = state.clock.tick(reading.time, self.patience)
        inputs, lost = _held(reading.inputs, state.inputs)
        repeated = reading.mask & state.taken & tick.duplicate
        sound = _sound(reading)
        mask = reading.mask & sound & ~repeated & ~tick.passed
        outputs = jnp.where(mask, reading.outputs, 0.0)
        scale = None if reading.scale is None else jnp.where(mask, reading.scale, 1.0)
        elapsed = tick.elapsed.astype(state.filter.x.dtype)
        filter = self._gated()
        moved, estimate = filter.step(state.filter, Sample(inputs, elapsed, outputs, mask, scale))
        broken = moved.diverged & ~tick.passed
        passed = tick.passed | broken
        # a filter asked about nothing would forget what its last measurement did before its rule has seen it
        idle = passed | ((elapsed <= 0.0) & ~jnp.any(mask))
        clock = Clock(reading.time, jnp.ones((), bool), jnp.zeros((), jnp.int32))
        waiting = dataclasses.replace(state.clock, behind=state.clock.behind + tick.behind.astype(jnp.int32))
        faults = state.faults.plus(
            untimed=tick.untimed,
            behind=tick.behind,
            restarts=tick.restarts & ~broken,
            duplicates=tick.duplicate & ~broken,
            gaps=(tick.elapsed > self.longest) & ~broken,
            inputs=lost & ~passed,
            saturated=self._saturated(reading.inputs) & ~passed,
            outputs=reading.mask & ~sound & ~passed,
            repeated=repeated & ~passed,
            rejected=mask & ~estimate.used & ~broken,
            recoveries=mask & ~broken & (state.filter.outside > 0) & (state.filter.outside == filter.gate.patience),
            broken=broken,
        )
        after = StreamState(
            select(idle, state.filter, moved),
            select(passed, waiting, clock),
            select(passed, state.inputs, inputs),
            jnp.where(passed, state.taken, (state.taken & tick.duplicate) | mask),
            faults,
        )
        return after, estimate

    def _saturated(self, inputs: PyTree[Array]) -> Bool[Array, ""]:
        if self.ranges is None:
            return jnp.zeros((), bool)
        at_stop = lambda value, most: jnp.any(jnp.isfinite(value) & (jnp.abs(value) >= most))
        stuck = jax.tree.map(at_stop, inputs, self.ranges)
        return jnp.any(jnp.stack(jax.tree.leaves(stuck)))


@compiled
def follow(stream: AbstractStream, state: Any, readings: Any) -> tuple[Any, Any]:
    """The state of `stream` after K `readings`, stacked, from `state`, and the estimates after each.

    `jax.vmap` takes it over many recordings.
    """
    return jax.lax.scan(lambda state, reading: stream.step(state, reading), state, readings)


def _held(inputs: PyTree[Array], last: PyTree[Array]) -> tuple[PyTree[Array], Bool[Array, ""]]:
    """`inputs` with the last good one for each array that is not finite, and whether there was such."""
    sound = jax.tree.map(lambda leaf: jnp.all(jnp.isfinite(leaf)), inputs)
    whole = jax.tree.map(lambda good, new, old: jnp.where(good, new, old), sound, inputs, last)
    return whole, ~jnp.all(jnp.stack(jax.tree.leaves(sound)))


def _sound(reading: Reading) -> Bool[Array, " c"]:
    finite = jnp.isfinite(reading.outputs)
    if reading.scale is None:
        return finite
    return finite & jnp.isfinite(reading.scale) & (reading.scale > 0.0)
