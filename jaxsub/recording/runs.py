"""Several recordings as one batch of arrays that simulation and likelihood take."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from ..arrays import Values, namespace
from .recording import Recording
from .turns import unwrapped, unwrapped_mechanism, without_jumps


class Runs(eqx.Module):
    """R recordings padded to K samples; what is padded has no weight and does not move the state.

    **Fields**

    - `times`: (R, K) s from each run's own start.
    - `steps`: (S,) the distinct sample intervals, s; `step_of`: (R, K-1) which of them each interval is.
    - `live`: (R, K-1) false where padded.
    - `signals`: (R, K, m) input columns; `held`: for each, whether it is held between samples or interpolated.
    - `outputs`: (R, K, c) measured channels, zero where missing; `mask`: (R, K, c) true where measured.
    - `counted`: for each channel, whether it is an angle whose whole turns are counted, so that it has no jumps.
    - `substeps`: integration steps in each sample interval.
    """

    times: Float[Array, "r k"]
    steps: Float[Array, " s"]
    step_of: Int[Array, "r k1"]
    live: Bool[Array, "r k1"]
    signals: Float[Array, "r k m"]
    outputs: Float[Array, "r k c"]
    mask: Bool[Array, "r k c"]
    held: tuple[bool, ...] = eqx.field(static=True)
    counted: tuple[bool, ...] = eqx.field(static=True)
    substeps: int = eqx.field(static=True, default=1)

    def nodes(self) -> Float[Array, "r k1 3 m1"]:
        """Signals, and after them the time (s), at the start, middle and end of each interval."""
        timed = jnp.concatenate([self.signals, self.times[..., None]], axis=-1)
        start, after = timed[:, :-1], timed[:, 1:]
        end = jnp.where(jnp.array([*self.held, False]), start, after)
        return jnp.stack([start, 0.5 * (start + end), end], axis=2)

    def samples(self) -> Int[Array, " c"]:
        """Measured samples of each channel."""
        return jnp.sum(self.mask, axis=(0, 1))

    def padded(self) -> "Runs":
        """With the samples, and the distinct intervals, padded to one of the numbers that `_few` gives.

        Programs that were compiled for recordings of about the same length then serve these.
        """
        more = _few(self.times.shape[1]) - self.times.shape[1]
        # by NumPy, for which no program has to be made
        own = {name: np.asarray(getattr(self, name)) for name in ("step_of", "signals", "live", "outputs", "mask")}
        mode = lambda name: "edge" if name in ("step_of", "signals") else "constant"
        longer = lambda name, array: np.pad(array, [(0, 0), (0, more), *[(0, 0)] * (array.ndim - 2)], mode=mode(name))
        times, steps = np.asarray(self.times), np.asarray(self.steps)
        later = times[:, -1:] + steps[0] * np.arange(1, more + 1)
        arrays = {name: longer(name, array) for name, array in own.items()}
        arrays["times"] = np.concatenate([times, later], axis=1)
        arrays["steps"] = np.pad(steps, (0, _few(len(steps)) - len(steps)), mode="edge")
        return dataclasses.replace(self, **jax.device_put(arrays))

    def take(self, chosen: Sequence[int], size: int) -> "Runs":
        """The runs numbered `chosen`, filled up to `size` with copies that count for nothing.

        Every batch that one call of a program makes then has one shape, and is compiled for once.
        """
        index = np.array([*chosen, *[chosen[0]] * (size - len(chosen))])
        arrays = ("times", "step_of", "live", "signals", "outputs", "mask")
        # by NumPy, for which no program has to be made
        taken = {name: np.asarray(getattr(self, name))[index] for name in arrays}
        there = np.arange(size) < len(chosen)
        taken["mask"] &= there[:, None, None]
        # a copy that nothing corrects could diverge
        taken["live"] &= there[:, None]
        return dataclasses.replace(self, **jax.device_put(taken))

    def share(self, some: slice) -> "Runs":
        """Some of the runs, and beyond the last one copies that count for nothing."""
        size, count = some.stop - some.start, len(self.times)
        return self if size == count else self.take(range(some.start, min(some.stop, count)), size)

    def segments(self, count: int) -> "Runs":
        """Every run cut into `count` pieces of equal length, each a run of its own that starts where the last ended.

        A sample that two pieces share is measured in the later one.
        """
        length = -(-(self.times.shape[1] - 1) // count)
        return self._pieces(length * np.arange(count), length, np.arange(count) == count - 1)

    def block(self, begin: int | Int[Array, ""], length: int) -> "Runs":
        """The `length` intervals of every run from the sample numbered `begin` on, padded beyond the runs' end.

        The sample that ends a block is measured in the next one; times are those of the whole run.
        """
        begins = jnp.asarray(begin)[None]
        return self._pieces(begins, length, begins + length >= self.times.shape[1] - 1)

    def _pieces(self, begins: Values, length: int, last: Values) -> "Runs":
        """The pieces of `length` intervals from each of the samples `begins`; those `last` measure their end."""
        # where begins are NumPy's no program has to be made
        xp, samples = namespace(begins), self.times.shape[1]
        index = begins[:, None] + xp.arange(length + 1)
        inside, between = xp.minimum(index, samples - 1), xp.minimum(index[:, :-1], samples - 2)
        cut = lambda array, at: array[:, at].reshape(len(array) * len(begins), *at.shape[1:], *array.shape[2:])
        owned = (xp.arange(length + 1) < length) | last[:, None]
        every = lambda array: xp.tile(array, (self.times.shape[0], 1))
        return dataclasses.replace(
            self,
            times=cut(self.times, inside),
            step_of=cut(self.step_of, between),
            live=cut(self.live, between) & every(index[:, 1:] < samples),
            signals=cut(self.signals, inside),
            outputs=cut(self.outputs, inside),
            mask=cut(self.mask, inside) & every(owned & (index < samples))[..., None],
        )


def _few(count: int) -> int:
    """The least number from `count` on that has four binary digits before its zeros: one eighth more at most."""
    unit = 2 ** max(0, count.bit_length() - 4)
    return -(-count // unit) * unit


def stack_runs(
    recordings: Sequence[Recording],
    *,
    held: Sequence[str],
    interpolated: Sequence[str],
    channels: Sequence[str],
    angles: Sequence[str] = (),
    substeps: int = 1,
) -> Runs:
    """The batch of `recordings` with those columns as held inputs, interpolated inputs and outputs.

    The turns of those that are `angles` are counted, where all recordings tell how many there are; of those among the
    interpolated always, by the shorter way. A column that can only be a wrapped angle loses its jumps.

    **Raises** `InputError` for a column that is absent and for a gap in an input column.
    """
    length = max(len(r.times) for r in recordings)
    pad = lambda a, fill: np.concatenate([a, np.broadcast_to(fill, (length - len(a), *a.shape[1:]))])
    times, signals, outputs, spacing = [], [], [], []
    whole = {name: found for name in angles if (found := _without_jumps(recordings, name))}
    for index, recording in enumerate(recordings):
        t = recording.times - recording.times[0]
        dt = np.diff(t)
        table = recording.inputs([*held, *interpolated])
        for at, name in enumerate((*held, *interpolated)):
            table[:, at] = _signal(recording, name, name in interpolated and name in angles)
        columns = [whole[name][index] if name in whole else _channel(recording, name, angles) for name in channels]
        measured = np.stack(columns, axis=1)
        times.append(np.concatenate([t, t[-1] + dt[-1] * np.arange(1, length - len(t) + 1)]))
        signals.append(pad(table, table[-1]))
        outputs.append(pad(measured, np.nan))
        spacing.append(np.concatenate([dt, np.full(length - len(t), -1.0)]))
    intervals = np.stack(spacing)
    # differences of float64 times carry rounding noise; intervals alike to that noise share one step
    noise = 8.0 * np.finfo(float).eps * max(float(np.abs(r.times).max()) for r in recordings)
    steps, step_of = _group(np.where(intervals > 0.0, intervals, intervals[intervals > 0.0][0]), noise)
    z = np.stack(outputs)
    arrays: dict[str, Any] = {
        "times": np.stack(times),
        "steps": steps,
        "step_of": step_of,
        "live": intervals > 0.0,
        "signals": np.stack(signals),
        "outputs": np.where(np.isnan(z), 0.0, z),
        "mask": ~np.isnan(z),
    }
    held_first = (True,) * len(held) + (False,) * len(interpolated)
    # `jnp.asarray` would make a program of every shape
    return Runs(
        **jax.device_put(arrays), held=held_first, counted=tuple(n in whole for n in channels), substeps=substeps
    )


def _signal(recording: Recording, name: str, turns: bool) -> np.ndarray:
    """An input column; one that `turns` is interpolated between samples and may not jump there."""
    values = recording.column(name)
    return unwrapped(values) if turns else _evident(recording, name)


def _channel(recording: Recording, name: str, angles: Sequence[str]) -> np.ndarray:
    """A measured column; one of the `angles` whose turns are in doubt as it was recorded."""
    return recording.column(name) if name in angles else _evident(recording, name)


def _evident(recording: Recording, name: str) -> np.ndarray:
    """A column without the jumps of an angle that is wrapped, where its file does not say that it is none."""
    values = recording.column(name)
    found = unwrapped_mechanism(values) if recording.units.get(name, "rad") == "rad" else None
    return values if found is None else found


def _without_jumps(recordings: Sequence[Recording], name: str) -> list[np.ndarray]:
    """An angle of each recording, its turns counted; none where one of them leaves these in doubt."""
    found = []
    for recording in recordings:
        angle = without_jumps(recording.times, recording.column(name))
        if angle is None:
            return []
        found.append(angle)
    return found


def _group(intervals: np.ndarray, noise: float) -> tuple[np.ndarray, np.ndarray]:
    """The distinct values among `intervals` to within `noise` or 1e-9 of themselves, and which one each is."""
    order = np.argsort(intervals, axis=None)
    ranked = intervals.ravel()[order]
    new = np.diff(ranked, prepend=-1.0) > np.maximum(noise, 1e-9 * ranked)
    group = np.cumsum(new) - 1
    members = np.bincount(group)
    which = np.empty(intervals.size, np.int32)
    which[order] = group
    return np.bincount(group, ranked) / members, which.reshape(intervals.shape)
