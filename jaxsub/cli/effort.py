"""What identifying a vehicle from long runs will take: memory, time, and the time left."""

import contextlib
import ctypes
import time
from collections.abc import Callable

from ..likelihood import block_length
from ..recording.runs import Runs
from ..vehicle import AbstractVehicle
from . import terminal

# samples from which on a command says what it will take
_LONG = 100_000
# `identify` on 1 000 000 rows, jax 0.12, two cores of a shared machine, November 2026: one coordinate 1.01 GB and 30 s
# of CPU from an empty cache, 0.74 GB and 19 s again; six degrees of freedom, 16 coefficients, 10 channels: 1.25 GB.
# bytes of the program and its compiler, copies of the recording's columns, and copies of the Jacobian of what is
# linearised at once: a block, or with actuators or sensors that remember all of it
_BASE, _COPIES, _OF_JACOBIAN = 9.0e8, 4, 2.5
# s for programs to be compiled, and for each sample, state and column of the Jacobian in a pass: 0.14 and 0.11 µs
_COMPILE, _EACH = 20.0, 1.2e-7
# passes over the samples: six of a usual search, one for the statistics, two for what follows
_PASSES = 9

# s in which nothing is said of the time left, and between two lines, on a terminal and on a pipe; and the share of a
# pass that tells how long the others will take
_SILENT, _TERMINAL, _PIPE, _TOLD = 2.0, 0.5, 10.0, 0.02

# glibc's number for the size from which on memory is mapped, and that size in bytes
_M_MMAP_THRESHOLD, _MAPPED = -3, 1_000_000


def return_memory() -> None:
    """Let large arrays go back to the system once they are freed, where the C library can be told to.

    glibc keeps blocks of up to 32 MB, which a million samples of a channel are: 1.7 GB at most and not 1.2 GB.
    """
    with contextlib.suppress(OSError, TypeError, AttributeError):
        ctypes.CDLL(None).mallopt(_M_MMAP_THRESHOLD, _MAPPED)


class Effort:
    """What the fit of a vehicle to runs, and what follows it, will take in memory and time."""

    def __init__(self, vehicle: AbstractVehicle, runs: Runs):
        layout = vehicle.layout
        self._samples, self._channels, self._states = runs.times.size, len(layout.channels), len(layout.states)
        self._recorded = 1 + runs.signals.shape[-1] + self._channels
        self._columns = len(layout.free) + self._states + 2 * len(layout.equations)
        self._at_once = block_length(vehicle, runs) * len(runs.times)

    def announcement(self) -> str:
        """What the fit of long runs will take, empty where they are short."""
        if self._samples < _LONG:
            return ""
        jacobian = _OF_JACOBIAN * self._at_once * self._columns * (self._states + self._channels)
        memory = (_BASE + 8.0 * (_COPIES * self._samples * self._recorded + jacobian)) / 1e9
        seconds = _COMPILE + _PASSES * _EACH * self._samples * self._columns * self._states
        size = f"{self._samples} samples of {self._channels} channels"
        return f"{size}: takes about {memory:.1f} GB and {_span(seconds)}; Ctrl-C after the fit keeps the fit"


class TimeLeft:
    """Says how many passes over long runs are done, how many are expected, and how long those will take.

    `told` takes the line, which begins with `what`. Nothing is said in the first seconds, nor too often.
    """

    def __init__(self, told: Callable[[str], object], what: str):
        self._told, self._what = told, what
        self._begun = self._said = time.monotonic()
        self._from: tuple[float, float] | None = None
        self._every = _TERMINAL if terminal.console.is_terminal else _PIPE

    def __call__(self, done: float, expected: float) -> None:
        """Tell of passes that are `done` of those `expected`."""
        now = time.monotonic()
        if self._from is None:
            # what came before was compiled, which tells nothing of what is to come
            self._from = (now, done)
            return
        before, already = self._from
        if now - self._begun < _SILENT or now - self._said < self._every or done - already < _TOLD:
            return
        self._said = now
        left = (now - before) * max(expected - done, 0.0) / (done - already)
        self._told(f"{self._what}: {done:.1f} of about {expected:.0f} passes over the samples, {_span(left)} left")


def _span(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 120.0 else f"{seconds / 60.0:.0f} min"
