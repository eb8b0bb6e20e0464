"""A vehicle's filter on a stream of rows, and the test of its innovations after each: one step, to be compiled.

Nothing a row holds makes a number but finite, and the state has the same size after any number of rows.
"""

import dataclasses
import math

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from ..filter import DisturbedProcess, Drive, Estimate, ExtendedKalmanFilter, Sample, linearised, select
from ..methods import jittable
from ..navigation import AbstractStream, Reading, Stream, StreamState
from .signatures import Linearisation, Signatures, scored, squares, whitened, window_lengths

# of z², odds of 20 to 1: changes that are no farther below the largest cannot be told from it yet
_UNTOLD = 2.0 * math.log(20.0)


class AlarmTest(eqx.Module):
    """When the innovations' statistic is an alarm.

    **Fields**

    - `threshold`: of the largest z² of any change in any window, without a unit. `variance`: (M, n + c) of z without a
      change, without a unit.
    - `quiet`: s below the threshold after which an alarm has ended.
    """

    threshold: Float[Array, ""]
    variance: Float[Array, "m q"]
    quiet: Float[Array, ""]


class MonitorState(eqx.Module):
    """What a monitor carries from row to row.

    **Fields**

    - `stream`: of its filter, and what was wrong with rows. `begun`: s, of the clock, when the run began.
    - `signatures`: of changes; `score`: (M, n + c) their products with the innovations, whitened.
    - `alarm`: whether one stands; `above`: s, when the statistic was above the threshold last.
    """

    stream: StreamState
    begun: Float[Array, ""]
    signatures: Signatures
    score: Float[Array, "m q"]
    alarm: Bool[Array, ""]
    above: Float[Array, ""]


class Observation(eqx.Module):
    """What is known after a row.

    **Fields**

    - `taken`: whether the row was used; where not, all else is of the row before.
    - `statistic`: the largest z² of any change in any window, over its variance, without a unit.
    - `change`: index among the n + c; `age`: samples since the window began.
    - `size`: the change's estimated size, N, N m or the channel's sigma; `size_std`: its standard deviation, in the
      same unit.
    - `likely`: (n + c,) changes that explain nearly as much, it among them.
    - `raised`, `ended`: whether an alarm begins or ends. `recovered`: (c,) channels that are believed again although
      they jumped.
    - `estimate`: of the filter.
    """

    taken: Bool[Array, ""]
    statistic: Float[Array, ""]
    change: Int[Array, ""]
    age: Int[Array, ""]
    size: Float[Array, ""]
    size_std: Float[Array, ""]
    likely: Bool[Array, " q"]
    raised: Bool[Array, ""]
    ended: Bool[Array, ""]
    recovered: Bool[Array, " c"]
    estimate: Estimate


class FilteredRow(eqx.Module):
    """A row as the filter met it: its linearisation and whitened innovation (c,), and whether it was `taken`.

    `fresh` is true where a run begins.
    """

    at: Linearisation
    white: Float[Array, "*k c"]
    taken: Bool[Array, " *k"]
    fresh: Bool[Array, " *k"]


class Monitor(AbstractStream):
    """Watches a vehicle by the innovations of a filter under Gauss–Markov forces.

    **Fields**

    - `stream`: the filter of a `DisturbedProcess`, gated. `sigma`: (c,) noise of the channels, SI.
    - `test`: of the innovations. `held`: for each signal whether it is held between rows or interpolated.
    """

    stream: Stream
    sigma: Float[Array, " c"]
    test: AlarmTest
    held: tuple[bool, ...] = eqx.field(static=True)

    @property
    def filter(self) -> ExtendedKalmanFilter:
        """The stream's filter."""
        assert isinstance(self.stream.filter, ExtendedKalmanFilter)
        return self.stream.filter

    @property
    def process(self) -> DisturbedProcess:
        """The vehicle and its disturbance."""
        process = self.filter.process
        assert isinstance(process, DisturbedProcess)
        return process

    def start(self, x: Float[Array, " s"]) -> MonitorState:
        """Before the first row, which will be of a vehicle at the state `x` (s,), SI."""
        n, c, m = self.process.force.size, self.sigma.size, len(self.held)
        z = jnp.concatenate([x, jnp.zeros(n)])
        begun = self.filter.start(z, jnp.zeros(0), jnp.zeros((0, 0)))
        like = self._reading(jnp.zeros(1 + m + c), jnp.zeros(m), jnp.zeros(()), jnp.zeros(()))
        signatures = Signatures.start(len(self.test.variance), z.size, n + c)
        zero = jnp.zeros(())
        return MonitorState(
            self.stream.start(begun, like), zero, signatures, jnp.zeros((len(signatures.age), n + c)), zero > 0, zero
        )

    def _reading(
        self, row: Float[Array, " w"], before: Float[Array, " m"], last: Float[Array, ""], begun: Float[Array, ""]
    ) -> Reading:
        """A row of time, signals and outputs, NaN where missing; `before` (m,) were the signals at the time `last`."""
        time, signals, outputs = row[0], row[1 : 1 + len(self.held)], row[1 + len(self.held) :]
        end = jnp.where(jnp.array(self.held, bool), before, signals)
        start, end = jnp.append(before, last - begun), jnp.append(end, time - begun)
        nodes = jnp.stack([start, 0.5 * (start + end), end])
        return Reading(time, Drive(nodes, time - begun, signals), outputs, ~jnp.isnan(outputs))

    @jittable
    def step(self, state: MonitorState, reading: Float[Array, " w"]) -> tuple[MonitorState, Observation]:
        """The next state and what is known after the row `reading` (1 + m + c,): time, signals and outputs, SI."""
        after, _, observation = self.examined(state, reading)
        return after, observation

    def examined(self, state: MonitorState, row: Float[Array, " w"]) -> tuple[MonitorState, FilteredRow, Observation]:
        """The next state, `row` as the filter met it from `state`, and what is known after it."""
        state, fresh = self._begun_anew(state, row)
        clock = state.stream.clock
        first = ~clock.started
        begun = jnp.where(first, row[0], state.begun)
        last = jnp.where(first, row[0], clock.time)
        before = jnp.where(first, row[1 : 1 + len(self.held)], state.stream.inputs.signals)
        stream, estimate = self.stream.step(state.stream, self._reading(row, before, last, begun))
        elapsed = jnp.where(first, 0.0, stream.clock.time - clock.time)
        broken = stream.faults.broken > state.stream.faults.broken
        taken = ((elapsed > 0.0) | jnp.any(estimate.used)) & ~broken & jnp.isfinite(row[0])
        at = self._linearisation(state.stream, stream, elapsed, estimate.used & taken)
        white = whitened(at, estimate.innovation)
        signatures, signs, restarted = state.signatures.after(at, self.sigma)
        score = scored(state.score, restarted, signs, white)
        moved = dataclasses.replace(state, stream=stream, begun=begun, signatures=signatures, score=score)
        passed = dataclasses.replace(state, stream=stream)
        after = select(taken, moved, passed)
        recovered = stream.faults.recoveries > state.stream.faults.recoveries
        after, observation = self._judged(after, row[0], taken, recovered, estimate)
        return after, FilteredRow(at, white, taken, fresh | first), observation

    def _begun_anew(self, state: MonitorState, row: Float[Array, " w"]) -> tuple[MonitorState, Bool[Array, ""]]:
        """The state, as before the first row where `row` comes after a gap that the model is not asked to bridge."""
        stream = state.stream
        gap = stream.clock.started & (row[0] - stream.clock.time > self.stream.longest)
        n = self.process.force.size
        filter = self.filter.restart(stream.filter, stream.filter.x.at[-n:].set(0.0))
        clock = dataclasses.replace(stream.clock, started=jnp.zeros((), bool))
        begun = dataclasses.replace(stream, filter=filter, clock=clock, faults=stream.faults.plus(gaps=gap))
        signatures = Signatures.start(*state.signatures.D.shape)
        anew = dataclasses.replace(state, stream=begun, signatures=signatures, score=jnp.zeros_like(state.score))
        return select(gap, anew, state), gap

    def _linearisation(
        self, before: StreamState, after: StreamState, elapsed: Float[Array, ""], used: Bool[Array, " c"]
    ) -> Linearisation:
        process, z, n = self.process, before.filter.x, self.process.force.size
        sample = Sample(after.inputs, elapsed, jnp.zeros_like(self.sigma), used)
        pushed = lambda z, push: process.pushed(z, sample, jnp.stack([push, push]))
        expected, F, force = linearised(pushed, z, jnp.zeros(n, z.dtype))
        moves = elapsed > 0.0
        expected = jnp.where(moves, expected, z)
        C = linearised(lambda z, _: process.observe(z, jnp.zeros(0), sample), expected, jnp.zeros(0))[1]
        gain = jnp.where(used, after.filter.residuals.gain, 0.0)
        factor = after.filter.residuals.factor
        return Linearisation(jnp.where(moves, F, jnp.eye(z.size)), jnp.where(moves, force, 0.0), C, gain, factor, used)

    def _judged(
        self,
        state: MonitorState,
        time: Float[Array, ""],
        taken: Bool[Array, ""],
        recovered: Bool[Array, " c"],
        estimate: Estimate,
    ) -> tuple[MonitorState, Observation]:
        """The test of a state's score."""
        information = state.signatures.information
        z2 = squares(state.score, information, self.test.variance)
        window, change = jnp.unravel_index(jnp.argmax(z2), z2.shape)
        statistic, known = z2[window, change], jnp.maximum(information[window, change], 1e-300)
        above = taken & ((statistic > self.test.threshold) | jnp.any(recovered))
        since = jnp.where(above, time, state.above)
        ended = state.alarm & taken & (time - since > self.test.quiet)
        after = dataclasses.replace(state, alarm=(state.alarm | above) & ~ended, above=since)
        observation = Observation(
            taken,
            statistic,
            change,
            jnp.minimum(state.signatures.age[window], jnp.asarray(window_lengths(len(z2)))[window]),
            state.score[window, change] / known,
            1.0 / jnp.sqrt(known),
            jnp.max(z2, axis=0) > statistic - _UNTOLD,
            above & ~state.alarm,
            ended,
            recovered,
            estimate,
        )
        return after, observation
