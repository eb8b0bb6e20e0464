"""What every command sets up: double precision, the compilation cache, progress on the terminal."""

import gc
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import jax
import platformdirs
from rich.console import Console
from rich.markup import escape
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    SpinnerColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from ..recording import Recording, load, read_selection
from ..vehicle import AbstractVehicle

console = Console(stderr=True)
# up to a third less time, for programs that run as fast; on jax 0.10 half, for programs up to a quarter slower
_QUICKLY, _QUICKER = "--xla_backend_optimization_level=1", "--xla_cpu_use_fusion_emitters=false"


def start(long: bool = False) -> None:
    """Double precision, and compiled programs kept in the user's cache folder.

    Unless what follows is `long`, it is compiled quickly rather than well.
    """
    if not long:
        _compile_quickly()
    # tracing makes millions of short-lived objects, and collecting them at the default threshold costs seconds
    gc.set_threshold(200_000, 50, 50)
    jax.config.update("jax_enable_x64", True)
    folder = Path(platformdirs.user_cache_dir("jaxsub")) / f"jax-{jax.__version__}"
    jax.config.update("jax_compilation_cache_dir", str(folder))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)


def _compile_quickly() -> None:
    """Options of XLA, which reads them when it first compiles, and ends the process at one that it does not know.

    What the caller set is left as it is.
    """
    given = os.environ.get("XLA_FLAGS", "").split()
    known = [_QUICKLY, *([_QUICKER] if jax.__version_info__[:2] == (0, 10) else [])]
    fresh = [flag for flag in known if not any(one.startswith(flag.split("=")[0]) for one in given)]
    os.environ["XLA_FLAGS"] = " ".join([*given, *fresh])


@contextmanager
def progress(title: str) -> Iterator[Callable[[str], None]]:
    """A spinner that says what is being done; on a pipe, a line for each thing."""
    if not console.is_terminal:
        yield lambda message: console.print(f"{title}: {message}", highlight=False, soft_wrap=True, markup=False)
        return
    columns = (
        SpinnerColumn(),
        TextColumn("{task.fields[title]}"),
        TextColumn("[bold]{task.description}"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("starting", total=None, title=title)
        yield lambda message: bar.update(task, description=escape(message))


@contextmanager
def counted(title: str) -> Iterator[Callable[[int, int], None]]:
    """A bar that is told how many are done of how many; on a pipe, a line for each further tenth."""
    if not console.is_terminal:
        said = [-1]

        def tell(done: int, total: int) -> None:
            if 10 * done // total > said[0]:
                said[0] = 10 * done // total
                console.print(f"{title}: {done} of {total}", highlight=False, soft_wrap=True, markup=False)

        yield tell
        return
    columns = (
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn()
    )  # fmt: skip
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task(escape(title), total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)


def load_runs(paths: Sequence[Path], vehicle: AbstractVehicle, columns: Path | None = None) -> list[Recording]:
    """The recordings at `paths`, refused at once where a column that `vehicle` needs is absent or has a gap.

    Of logs the file at `columns` says what to take.
    """
    recordings = [load_run(path, vehicle, columns) for path in paths]
    layout = vehicle.layout
    for recording in recordings:
        recording.inputs([*layout.held, *layout.interpolated])
        for channel in layout.channels:
            recording.column(channel)
    return recordings


def load_run(path: Path, vehicle: AbstractVehicle, columns: Path | None = None) -> Recording:
    """The recording at `path`; of a log, inputs are held and prescribed motions interpolated as `vehicle` has them."""
    chosen = None if columns is None else read_selection(columns)
    return load(path, chosen, held=vehicle.layout.held, interpolated=vehicle.layout.interpolated)
