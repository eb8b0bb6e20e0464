"""What identifying a vehicle from long runs will take: memory, time, and the time left."""

import contextlib
import ctypes
import time

from ..recording.runs import Runs
from ..vehicle import AbstractVehicle

# samples from which on a command says what it will take
_LONG = 100_000
# bytes that the program itself takes; doubles kept at once for each column of the channels' Jacobian, and of the step's
_BASE, _BY_COLUMN, _BY_STEP = 4.5e8, 6, 2
# s for programs to be compiled, and for each sample and column of the Jacobian, on one core of 2024
_COMPILE, _EACH = 20.0, 3e-6
# what follows the fit takes this part of the fit's own time
_AFTER = 0.9

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
        self.begun = time.monotonic()

    def announcement(self) -> str:
        """What the fit of long runs will take, empty where they are short."""
        if self.samples < _LONG:
            return ""
        memory = (_BASE + 8.0 * self.doubles * self.samples) / 1e9
        seconds = _COMPILE + _EACH * self.columns * self.samples
        size = f"{self.samples} samples of {self.channels} channels"
        return f"{size}: takes about {memory:.1f} GB and {_span(seconds)}; Ctrl-C after the fit keeps the fit"

    def left(self) -> str:
        """What follows the fit will take about this long, judged by the fit; empty for short runs."""
        if self.samples < _LONG:
            return ""
        return f"; about {_span(_AFTER * (time.monotonic() - self.begun))} left"


def _span(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 120.0 else f"{seconds / 60.0:.0f} min"
