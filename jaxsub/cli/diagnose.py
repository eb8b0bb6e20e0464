"""`jaxsub diagnose`: the whole path."""

from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path

from rich.panel import Panel
from rich.text import Text

from ..api.diagnoses import Diagnosis, diagnosed
from ..effects import AbstractEffect, from_script, vocabulary
from ..errors import InputError, OutputError
from ..estimate import require_free
from ..recording import Recording, hold_out
from ..vehicle import AbstractVehicle, added_effects, read_vehicle
from ..workers import working_on
from . import session, terminal
from .options import options
from .output import Fresh, fresh_folders, paths_of
from .runs import load_train_and_test


def run(
    vehicle_path: Path,
    runs: Sequence[Path],
    held: Sequence[Path],
    out: Path,
    overwrite: bool,
    script: Path | None = None,
    manoeuvre: bool = True,
    columns: Path | None = None,
    explain: bool = False,
    budget: float | None = None,
    begin: Path | None = None,
    cluster: str | None = None,
) -> None:
    """Diagnose the recordings at `runs`, shown on the test runs at `held` or on what `hold_out` sets aside.

    Effects that the Python file at `script` defines are tried with those that are installed. Of logs the file at
    `columns` says what to take. `explain` prints every decision. After `budget` seconds, or at Ctrl-C, the answer so
    far is given. It is put at `out` after each effect that is accepted, and stays there whatever ends what follows.
    The vehicle file at `begin` is the improved one of such an answer, from which this one goes on. `cluster` is as of
    `working_on`.
    """
    session.start()
    with fresh_folders(out, overwrite, paths_of(vehicle_path, *runs, *held, script, columns, begin)) as fresh:
        own = () if script is None else from_script(script)
        vehicle = read_vehicle(vehicle_path, own)
        require_free(vehicle, str(vehicle_path))
        first = () if begin is None else added(vehicle, begin, (*vocabulary(), *own))
        recordings, unseen = load_train_and_test(runs, held, vehicle, columns)
        train, test = (recordings, unseen) if held else hold_out(recordings)
        keep = lambda found: _keep(found, fresh, out)
        with working_on(cluster):
            answer = answered(vehicle, train, test, (*vocabulary(), *own), manoeuvre, budget, keep, first)
        # shown before it is written: where writing fails, minutes of work are not lost
        emit(answer, explain)
        terminal.warn(answer.warnings)
        with fresh() as folder:
            answer.write(folder)
    terminal.note(f"report: {out / 'report.html'}")
    if not answer.complete and (watch := options().watch) is not None and watch.interrupted:
        options().kept = _held(answer, out)
        raise KeyboardInterrupt


def added(vehicle: AbstractVehicle, improved: Path, kinds: tuple[type[AbstractEffect], ...]) -> list[AbstractEffect]:
    """The effects of `kinds` that the vehicle file `improved` has more than a vehicle."""
    own = [kind for kind in kinds if kind not in vocabulary()]
    found = added_effects(read_vehicle(improved, own), vehicle, kinds)
    if not found:
        raise InputError(str(improved), "has no effect that the vehicle lacks", "leave out --begin")
    return found


def _keep(answer: Diagnosis, fresh: Fresh, out: Path) -> None:
    """Put an answer on the way at `out`. Where it cannot be written, the command says so with the last one."""
    with suppress(OutputError):
        with fresh() as folder:
            answer.write_numbers(folder)
        options().kept = _held(answer, out)


def _held(answer: Diagnosis, out: Path) -> str:
    return f"{out} holds the answer{'' if answer.complete else ' so far, which is incomplete'}"


def answered(
    vehicle: AbstractVehicle,
    train: Sequence[Recording],
    test: Sequence[Recording],
    kinds: tuple[type[AbstractEffect], ...] | None = None,
    manoeuvre: bool = True,
    budget: float | None = None,
    keep: Callable[[Diagnosis], object] = lambda found: None,
    begin: Sequence[AbstractEffect] = (),
) -> Diagnosis:
    """The diagnosis by checked runs with its progress shown, and a first interruption heeded once there is an answer.

    Arguments are as of `api.diagnoses.diagnosed`; where rivals remain and a `manoeuvre` is wanted, it is looked for.
    """
    watch = options().watch
    with terminal.progress(f"diagnosing {vehicle.layout.name}") as progress, ExitStack() as kept:

        def keep_and_heed(found: Diagnosis) -> None:
            keep(found)
            # before there is an answer an interruption ends all at once
            if watch is not None:
                kept.enter_context(watch.heeded())

        stop = lambda: watch is not None and watch.interrupted
        found = diagnosed(
            vehicle, train, test, kinds, budget=budget, progress=progress, stop=stop, keep=keep_and_heed, begin=begin
        )
        kept.close()
        if not (manoeuvre and found.undecided):
            return found
        keep(found)
        return found.with_next_run(train, progress)


def emit(answer: Diagnosis, explain: bool = False) -> None:
    """Print the verdict, or with `--json` what `diagnosis.json` holds, on standard output."""
    terminal.emit(answer.conclusions.to_json(), lambda: show(answer, explain))


def show(answer: Diagnosis, explain: bool = False) -> None:
    """The verdict, the effects that were named, and the errors on the test runs, on standard output.

    `explain` adds a row for every decision, in order.
    """
    title = answer.verdict + ("" if answer.complete else " (incomplete)")
    terminal.results.print(Panel(Text(answer.sentence), title=title, expand=False), soft_wrap=False)
    terminal.show([*answer.tables(), *([answer.decisions()] if explain else [])])
