"""Shares of the runs: what is summed over runs is worked out for a few of them at a time, side by side on cores.

Memory is then that of as many shares as there are cores, however many runs there are. On a cluster workers have them.
"""

from collections.abc import Callable, Sequence
from functools import partial
from threading import Lock
from typing import TypeVar

import jax
import numpy as np

from ..arrays import Values, aligned_zeros
from ..workers import on_workers

R = TypeVar("R")
T = TypeVar("T")

# samples of a share: fewer take longer in calls of programs
_SAMPLES = 4096


def shares(runs: int, samples: int) -> list[slice]:
    """Shares, alike in size, of so many `runs` of so many `samples` each; the last may reach beyond the last run."""
    count = -(-runs // max(1, _SAMPLES // samples))
    size = -(-runs // count)
    return [slice(first, first + size) for first in range(0, runs, size)]


def by_share(function: Callable[..., R], own: Callable[[slice], tuple], runs: int, samples: int) -> list[R]:
    """`function` of what is the `own` of each of the `shares` of so many `runs` of so many `samples`, in order.

    A cluster finds the function by its name. Not to be called in `jit`.
    """
    return on_workers(function, [partial(own, some) for some in shares(runs, samples)])


class Progress:
    """How much of a pass over shares is done: `watch` is called with that, from one thread at a time."""

    def __init__(self, every: Sequence[slice], watch: Callable[[float], object]):
        self._done = {some.start: 0.0 for some in every}
        self._watch, self._lock = watch, Lock()

    def of(self, some: slice) -> "ShareProgress":
        """Called with how much of a share is done."""
        return ShareProgress(self, some.start)

    def tell(self, first: int, part: float) -> None:
        """So much of the share that begins with the run `first` is done."""
        with self._lock:
            self._done[first] = part
            self._watch(sum(self._done.values()) / len(self._done))


class ShareProgress:
    """Called with how much of a share is done; on a worker of a cluster nobody learns it."""

    def __init__(self, progress: Progress | None = None, first: int = 0):
        self._progress, self._first = progress, first

    def __call__(self, part: float) -> None:
        """So much of it is done."""
        if self._progress is not None:
            self._progress.tell(self._first, part)

    def __reduce__(self) -> tuple:
        return ShareProgress, ()


def share_of(values: T, runs: slice) -> T:
    """Some of the `runs`, the first axis of all `values`, and zeros beyond the last. Not to be called in `jit`."""
    size = runs.stop - runs.start

    def some(M: Values) -> Values:
        if size == len(M):
            return M
        # by NumPy: to cut arrays of JAX would be a program for each place
        found = np.asarray(M)[runs]
        return jax.device_put(np.pad(found, [(0, size - len(found)), *[(0, 0)] * (found.ndim - 1)]))

    return jax.tree.map(some, values)


def joined(parts: Sequence[T], runs: int) -> T:
    """The arrays of consecutive shares, `parts`, as those of all `runs`. Not to be called in `jit`."""
    if len(parts) == 1:
        return jax.device_put(parts[0])

    def whole(*some: Values) -> Values:
        found, size = aligned_zeros((runs, *some[0].shape[1:]), some[0].dtype), len(some[0])
        for index, part in enumerate(some):
            own = found[index * size : (index + 1) * size]
            own[...] = np.asarray(part)[: len(own)]
        # placed where programs take it from, which copies nothing
        return jax.device_put(found)

    return jax.tree.map(whole, *parts)
