"""Room for compiled programs: every set of effects has its own, and a process can hold only so many."""

import gc
from pathlib import Path

import jax

_MAPS = Path("/proc/self/maps")
# Linux gives a process 65 530 memory maps; a program takes some hundreds, and without one more the process dies
_MANY = 30_000


def make_room() -> None:
    """Drop JAX's compiled programs where they take so many memory maps that the next few may not find any.

    They are compiled again when they are needed, or read from JAX's cache on disk where the caller has set one.
    """
    if _MAPS.exists() and _MAPS.read_bytes().count(b"\n") > _MANY:
        jax.clear_caches()
        gc.collect()
