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
# `identify` on 100 000 rows, jax 0.12, two cores of a shared machine, November 2026, from an empty cache of programs
# and again: one coordinate, 3 coefficients, 17 s and 6 s of CPU, 0.82 GB and 0.53 GB; six degrees of freedom, 20
# coefficients that begin 10 to 15 % off, 10 channels, 18 passes: 170 s and 119 s, 1.39 GB and 0.96 GB.
# bytes of the program, its compiler and the windows of coloured errors, copies of the recording's columns, and copies
# of the Jacobian of what is linearised at once: a block, or with actuators or sensors that remember all of it
_BASE, _COPIES, _OF_JACOBIAN = 1.0e9, 4, 2.5
# s before and after the passes with programs in the cache and without, each and for each column of the Jacobian
_KEPT, _COMPILED = (1.8, 0.4), (4.8, 1.5)
# s for each sample, state and column of the Jacobian in a pass
_EACH = 1.2e-7
# passes over the samples, and for each coefficient: those of a search, one for the statistics, two for what follows.
# a search whose coefficients the runs hardly tell apart takes up to three times as many
_PASSES, _OF_COEFFICIENT = 7, 0.65

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
        self._coefficients = len(layout.free)
        self._columns = self._coefficients + self._states + 2 * len(layout.equations)
        self._at_once = block_length(vehicle, runs) * len(runs.times)

    def announcement(self) -> str:
        """What the fit of long runs will take, empty where they are short."""
        if self._samples < _LONG:
            return ""
        jacobian = _OF_JACOBIAN * self._at_once * self._columns * (self._states + self._channels)
        memory = (_BASE + 8.0 * (_COPIES * self._samples * self._recorded + jacobian)) / 1e9
        passes = _PASSES + _OF_COEFFICIENT * self._coefficients
        passing = passes * _EACH * self._samples * self._columns * self._states
        least, most = (passing + fixed + each * self._columns for fixed, each in (_KEPT, _COMPILED))
        size = f"{self._samples} samples of {self._channels} channels"
        time = f"{_span(least)}, {_span(most)} the first time"
        return f"{size}: takes about {memory:.1f} GB and {time}; Ctrl-C after the fit keeps the fit"


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
