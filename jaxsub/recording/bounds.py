"""How much a file may claim to hold for its size."""

import os

from jaxsub.errors import InputError

# Deflate expands a constant column 1000 times; what claims more than that, and more than a small file may, is damaged.
_EXPANSION = 1000
_ALWAYS = 2**28  # bytes


def most(size: int) -> int:
    """The bytes of samples that `size` bytes of a file may hold at most."""
    return max(_ALWAYS, _EXPANSION * size)


def require_plausible(source: str, claimed: int, size: int) -> None:
    """Raise InputError where `size` bytes of a file claim to hold `claimed` bytes of samples and cannot."""
    if claimed > most(size):
        what = f"claims {_bytes(claimed)} of samples in {_bytes(size)}, above {_EXPANSION} times its size"
        raise InputError(source, what, "check that it is whole, or write it anew")
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") if hasattr(os, "sysconf") else claimed
    if claimed > memory:
        what = f"holds {_bytes(claimed)} of samples, above the {_bytes(memory)} of memory of this machine"
        raise InputError(source, what, "divide the file, or leave columns out")


def _bytes(count: int) -> str:
    for power, name in ((4, "TiB"), (3, "GiB"), (2, "MiB"), (1, "KiB")):
        if count >= 1024**power:
            return f"{count / 1024**power:.3g} {name}"
    return f"{count} bytes"
