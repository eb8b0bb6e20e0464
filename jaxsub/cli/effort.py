"""What identifying a vehicle from long runs will take: memory, time, and the time left."""

import contextlib
import ctypes
import functools
import time
from collections.abc import Callable

import jax

from ..likelihood import shares
from ..likelihood.blocks import block_length
from ..programs import cores
from ..recording.runs import Runs
from ..vehicle import AbstractVehicle
from . import terminal

# samples from which on a command says what it will take
_LONG = 100_000
# `identify`, jax 0.12, one core, November 2026, from an empty cache of programs: one coordinate, 3 coefficients,
# 1 000 000 rows: 32 s of CPU and 0.84 GB; six degrees of freedom, 16 coefficients, 10 channels: 20 000 rows 45 s and
# 0.90 GB, 1 000 000 rows 620 s and 1.13 GB.
# bytes of the program, its compiler and the windows of coloured errors, copies of the recording's columns, and copies
# of the Jacobian of what is linearised at once: a block, or with actuators or sensors that remember all of it
_BASE, _COPIES, _OF_JACOBIAN = 0.85e9, 2, 2.5
# bytes of the program and copies of the columns while these are read
_READER, _READ = 0.3e9, 7
# s before and after the passes with programs in the cache and without, each and for each column of the Jacobian
_KEPT, _COMPILED = (1.8, 0.4), (4.8, 1.5)
# s for each sample, state and column of the Jacobian in a pass
_EACH = 1.2e-7
# passes over the samples, and for each coefficient: those of a search, one for the statistics, three for what follows.
# a search whose coefficients the runs hardly tell apart takes up to three times as many
_PASSES, _OF_COEFFICIENT = 8, 0.65

# s in which nothing is said of the time left, and between two lines, on a terminal and on a pipe; and the share of a
# pass that tells how long the others will take
_SILENT, _TERMINAL, _PIPE, _TOLD = 2.0, 0.5, 10.0, 0.02

# glibc's number for the size from which on memory is mapped, and that size in bytes
_M_MMAP_THRESHOLD, _MAPPED = -3, 1_000_000
# what JAX calls the end of a compilation, or of reading a program from the cache
_COMPILED_EVENT = "/jax/core/compile/backend_compile_duration"


@functools.cache
def return_memory() -> None:
    """Let memory go back to the system once it is freed, where the C library can do so.

    glibc keeps blocks of up to 32 MB, which a million samples of a channel are, and what the compiler freed among what
    it keeps: 0.3 GB after one large program.
    """
    with contextlib.suppress(OSError, TypeError, AttributeError):
        library = ctypes.CDLL(None)
        library.mallopt(_M_MMAP_THRESHOLD, _MAPPED)
        trim = library.malloc_trim

        def ended(event: str, duration_secs: float, **_: str | int) -> None:
            if event == _COMPILED_EVENT:
                trim(0)

        jax.monitoring.register_event_duration_secs_listener(ended)


class Effort:
    """What the fit of a vehicle to runs, and what follows it, will take in memory and time."""

    def __init__(self, vehicle: AbstractVehicle, runs: Runs):
        layout = vehicle.layout
        self._samples, self._channels, self._states = runs.times.size, len(layout.channels), len(layout.states)
        self._recorded = 1 + runs.signals.shape[-1] + self._channels
        self._coefficients = len(layout.free)
        self._columns = self._coefficients + self._states + 2 * len(layout.equations)
        every = shares(*runs.times.shape)
        share = runs.share(every[0])
        self._at_once = block_length(vehicle, share) * len(share.times) * min(cores(), len(every))

    def announcement(self) -> str:
        """What the fit of long runs will take, empty where they are short."""
        if self._samples < _LONG:
            return ""
        jacobian = _OF_JACOBIAN * self._at_once * self._columns * (self._states + self._channels)
        columns = self._samples * self._recorded
        fitting = _BASE + 8.0 * (_COPIES * columns + jacobian)
        memory = max(fitting, _READER + 8.0 * _READ * columns) / 1e9
        passes = _PASSES + _OF_COEFFICIENT * self._coefficients
        passing = passes * _EACH * self._samples * self._columns * self._states
        least, most = (passing + fixed + each * self._columns for fixed, each in (_KEPT, _COMPILED))
        size = f"{self._samples} samples of {self._channels} channels"
        time = f"{_span(least)}, {_span(most)} the first time"
        return f"{size}: takes about {memory:.1f} GB and {time}; Ctrl-C after the fit keeps the fit"


class TimeLeft:
    """Says how many passes over long runs are done, how many are expected, and how long those will take.

    `show` takes the line, which begins with `what`. Nothing is said in the first seconds, nor too often.
    """

    def __init__(self, show: Callable[[str], object], what: str):
        self._show, self._what = show, what
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
        self._show(f"{self._what}: {done:.1f} of about {expected:.0f} passes over the samples, {_span(left)} left")


def _span(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 120.0 else f"{seconds / 60.0:.0f} min"
