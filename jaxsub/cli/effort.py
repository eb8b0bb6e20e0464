"""What identifying a vehicle from long runs will take: memory, time, and the time left."""

import contextlib
import ctypes
import time
from collections.abc import Callable

from ..recording.runs import Runs
from ..vehicle import AbstractVehicle
from . import terminal

# samples from which on a command says what it will take
_LONG = 100_000
# bytes that the program itself takes; doubles kept at once for each column of the channels' Jacobian, and of the step's
_BASE, _BY_COLUMN, _BY_STEP = 4.5e8, 6, 2
# s for programs to be compiled, and for each sample and column of the Jacobian, on one core of 2024
_COMPILE, _EACH = 20.0, 3e-6
# s in which nothing is said of the time left; and between two lines, on a terminal and on a pipe
_SILENT, _TERMINAL, _PIPE = 2.0, 0.5, 10.0

# glibc's number for the size from which on memory is mapped, and that size in bytes
_M_MMAP_THRESHOLD, _MAPPED = -3, 1_000_000


def return_memory() -> None:
    """Let large arrays go back to the system once they are freed, where the C library can be told to.

    glibc keeps blocks of up to 32 MB, which a million samples of a channel are: 1.7 GB at most and not 1.2 GB.
    """
    with contextlib.suppress(OSError, TypeError, AttributeError):
        ctypes.CDLL(None).mallopt(_M_MMAP_THRESHOLD, _MAPPED)


class Effort:
    """How much work the fit of a vehicle to runs is, and how long what follows will take."""

    def __init__(self, vehicle: AbstractVehicle, runs: Runs):
        layout = vehicle.layout
        s, n, c = len(layout.states), len(layout.equations), len(layout.channels)
        self.samples, self.channels = runs.times.size, c
        self.columns = len(layout.free) + s + 1
        self.doubles = _BY_COLUMN * c * self.columns + _BY_STEP * s * (s + 2 * n + c)

    def announcement(self) -> str:
        """What the fit of long runs will take, empty where they are short."""
        if self.samples < _LONG:
            return ""
        memory = (_BASE + 8.0 * self.doubles * self.samples) / 1e9
        seconds = _COMPILE + _EACH * self.columns * self.samples
        size = f"{self.samples} samples of {self.channels} channels"
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
        if now - self._begun < _SILENT or now - self._said < self._every or done <= already:
            return
        self._said = now
        left = (now - before) * max(expected - done, 0.0) / (done - already)
        self._told(f"{self._what}: {done:.1f} of about {expected:.0f} passes over the samples, {_span(left)} left")


def _span(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 120.0 else f"{seconds / 60.0:.0f} min"
