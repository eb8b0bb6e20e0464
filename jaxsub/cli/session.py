"""What every command sets up: double precision and the compilation cache."""

import glob
import math
import os
import re
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import jax
import platformdirs

from ..programs import keep_programs
from . import terminal

# up to a third less time, for programs that run as fast; on jax 0.10 half, for programs up to a quarter slower
_QUICKLY, _QUICKER = "--xla_backend_optimization_level=1", "--xla_cpu_use_fusion_emitters=false"
# bytes of recordings up to which nothing is optimised: another third less time, 5 s of `identify`, for programs that
# take twice as long, 3 s more a million bytes
_AS_QUICKLY_AS_CAN_BE, _SMALL = "--xla_backend_optimization_level=0", 200_000
_CACHE_FAILS = r"Error (reading|writing) persistent compilation cache entry for '([^']*)'"


def start(long: bool = False, recordings: Sequence[Path] = ()) -> None:
    """Double precision, and compiled programs kept in the user's cache folder.

    Unless what follows is `long`, it is compiled quickly rather than well; where it makes one pass after another over
    `recordings` that are small files, as quickly as can be. Nor does it then take an accelerator, unless
    `JAX_PLATFORMS` names one: a filter's samples follow each other, and an H100 takes 146 s for the demo where the
    processor beside it takes 83.
    """
    if not long:
        choose_device()
        _compile_quickly(_AS_QUICKLY_AS_CAN_BE if recordings and _size(recordings) <= _SMALL else _QUICKLY)
    jax.config.update("jax_enable_x64", True)
    _keep_programs()


def choose_device() -> None:
    """The processor, unless `JAX_PLATFORMS` names another device."""
    jax.config.update("jax_platforms", os.environ.get("JAX_PLATFORMS") or "cpu")


def _keep_programs() -> None:
    """Keep compiled programs in the user's cache; without a folder for it, go on and compile them every time."""
    try:
        folder = _cache() / f"jax-{jax.__version__}"
        lowered = folder / "lowered"
        lowered.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        where = f"{error.filename}: {error.strerror}" if error.filename else error
        terminal.note(f"note: compiled programs are not kept: {where}; set XDG_CACHE_HOME")
        return
    jax.config.update("jax_compilation_cache_dir", str(folder))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)
    keep_programs(lowered)
    _repair(folder)


def _cache() -> Path:
    """The user's cache folder for jaxsub. **Raises** `OSError` where there is none, as for a user without a home."""
    try:
        folder = Path(platformdirs.user_cache_dir("jaxsub"))
    except RuntimeError:
        folder = Path()
    # some versions of platformdirs raise, others answer with a folder named ~
    if not folder.is_absolute():
        raise OSError("there is no home folder")
    return folder


class _Repair:
    """A handler of warnings that removes damaged entries of the cache in `folder` when JAX meets them.

    JAX warns of an entry that it cannot read, compiles, and does not write where a file is: the damage would stay. The
    warning comes before it compiles, so a file removed at the warning is written anew by the same run. It is said once;
    `show` is what handles other warnings.
    """

    def __init__(self, folder: Path, show: Callable[..., None]):
        self._folder, self._said, self.show = folder, set[str](), show

    def __call__(self, message: Warning | str, *where: Any, **more: Any) -> None:
        found = re.match(_CACHE_FAILS, str(message))
        if found is None:
            self.show(message, *where, **more)
            return
        failed, program = found.groups()
        if failed == "reading":
            # the name's other entries go too: which of them is damaged the warning does not say
            for entry in self._folder.glob(f"{glob.escape(program)}-*"):
                entry.unlink(missing_ok=True)
        if failed not in self._said:
            self._said.add(failed)
            done = {"reading": "damaged entries are replaced", "writing": "a compiled program could not be kept"}
            terminal.note(f"note: {self._folder}: {done[failed]}")


def _repair(folder: Path) -> None:
    """Have damaged entries of the cache in `folder`, and of no other, repaired from now on."""
    warnings.filterwarnings("always", message=_CACHE_FAILS)
    show = warnings.showwarning
    warnings.showwarning = _Repair(folder, show.show if isinstance(show, _Repair) else show)


def _size(paths: Sequence[Path]) -> float:
    """Bytes of the files at `paths`, infinite where one is none."""
    return sum((path.stat().st_size if path.is_file() else math.inf for path in paths), 0.0)


def _compile_quickly(level: str) -> None:
    """Options of XLA, `level` among them; what the caller set is left as it is.

    XLA reads them when it first compiles, and ends the process at one that it does not know.
    """
    given = os.environ.get("XLA_FLAGS", "").split()
    known = [level, *([_QUICKER] if jax.__version_info__[:2] == (0, 10) else [])]
    fresh = [flag for flag in known if not any(one.startswith(flag.split("=")[0]) for one in given)]
    os.environ["XLA_FLAGS"] = " ".join([*given, *fresh])
