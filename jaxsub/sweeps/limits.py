"""What a sweep needs of memory, estimated before anything is computed."""

import math
import os
from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from ..errors import InputError
from ..recording import Recording
from ..vehicle import AbstractVehicle

# arrays of all searches that the summary and its figures hold at once
_COPIES = 3
# of a search's Jacobian
_JACOBIANS = 6
# part of the searches whose noisy recordings are held at once (`Plan.chunk_width`)
_CHUNKS = 500
_UNITS = ("B", "kB", "MB", "GB", "TB", "PB")


def require_memory(
    vehicles: Mapping[str, AbstractVehicle],
    sets: Mapping[str, Collection[Recording]],
    starts: int,
    noise: int,
) -> None:
    """Raise `InputError` where a sweep of `starts` guesses and `noise` seeds needs more memory than is available.

    `vehicles` and `sets` of recordings are named as in `Plan`.
    """
    cases = [(vehicle, list(recorded)) for vehicle in vehicles.values() for recorded in sets.values()]
    count = starts * max(1, noise)
    searches = count * len(cases)
    needed = _kept(cases, searches) + max(_worked(vehicle, runs, count, noise) for vehicle, runs in cases)
    there = available_memory()
    if there is not None and needed > there:
        what = f"{searches:.4g} searches need about {_said(needed)} of memory and {_said(there)} are available"
        raise InputError("sweep", what, "give fewer --starts or --noise-seeds, fewer runs or a smaller model")


def _kept(cases: Sequence[tuple[AbstractVehicle, list[Recording]]], searches: int) -> float:
    """Bytes of the answers of all searches."""
    free = max(len(vehicle.layout.free) for vehicle, _ in cases)
    coordinates = max(_columns(vehicle, runs) for vehicle, runs in cases)
    return 8.0 * _COPIES * searches * (3 * free + coordinates + 4)


def _worked(vehicle: AbstractVehicle, runs: list[Recording], count: int, noise: int) -> float:
    """Bytes of one search and of the noisy recordings of one chunk."""
    outputs = len(runs) * max(len(run.times) for run in runs) * len(vehicle.layout.channels)
    states, columns = len(vehicle.layout.states), _columns(vehicle, runs)
    drawn = outputs * count / _CHUNKS if noise else 0.0
    return 8.0 * (_JACOBIANS * outputs * columns + columns * states**2 + drawn)


def _columns(vehicle: AbstractVehicle, runs: list[Recording]) -> int:
    return len(vehicle.layout.free) + len(runs) * len(vehicle.layout.states)


def available_memory() -> float | None:
    """Bytes that this process may take, None where the system does not say."""
    found = []
    try:
        lines = dict(line.split(":", 1) for line in Path("/proc/meminfo").read_text(encoding="utf-8").splitlines())
        found.append(1024.0 * float(lines["MemAvailable"].split()[0]))
    except (OSError, KeyError, ValueError):  # not Linux
        with suppress(OSError, ValueError, AttributeError):
            found.append(float(os.sysconf("SC_PHYS_PAGES")) * os.sysconf("SC_PAGE_SIZE"))
    with suppress(OSError, ValueError):  # a container's share, where it has a limit
        limit, used = (float(Path(f"/sys/fs/cgroup/memory.{name}").read_text()) for name in ("max", "current"))
        found.append(limit - used)
    return min(found, default=None)


def _said(size: float) -> str:
    power = min(int(math.log10(max(size, 1.0)) // 3), len(_UNITS) - 1)
    return f"{size / 1000.0**power:.3g} {_UNITS[power]}"
