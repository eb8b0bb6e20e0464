"""`jaxsub diagnose`: the whole path."""

import dataclasses
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from pathlib import Path

from rich.panel import Panel
from rich.text import Text

from ..discrepancy import Conclusions
from ..discrepancy import diagnose as diagnose_runs
from ..discrepancy.decisions import decision_rows
from ..discrepancy.next_run import next_run, said
from ..discrepancy.procedure import Keep
from ..effects import AbstractEffect, from_script, vocabulary
from ..errors import InputError, OutputError
from ..estimate import require_free
from ..plain import to_json
from ..recording import Recording, hold_out, save
from ..report import write_report
from ..report.text import measurement, percent, ratio, unit
from ..vehicle import AbstractVehicle, added_effects, read_vehicle, vehicle_text, with_coefficients
from . import session, terminal
from .options import options
from .output import Fresh, fresh_folders, paths_of
from .runs import load_train_and_test

_NEXT = "next_manoeuvre.csv"


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
) -> None:
    """Diagnose the recordings at `runs`, shown on the test runs at `held` or on what `hold_out` sets aside.

    Effects that the Python file at `script` defines are tried with those that are installed. Of logs the file at
    `columns` says what to take. `explain` prints every decision. After `budget` seconds, or at Ctrl-C, the answer so
    far is given. It is put at `out` after each effect that is accepted, and stays there whatever ends what follows.
    The vehicle file at `begin` is the improved one of such an answer, from which this one goes on.
    """
    session.start()
    with fresh_folders(out, overwrite, paths_of(vehicle_path, *runs, *held, script, columns, begin)) as fresh:
        own = () if script is None else from_script(script)
        vehicle = read_vehicle(vehicle_path, own)
        require_free(vehicle, str(vehicle_path))
        first = () if begin is None else added(vehicle, begin, (*vocabulary(), *own))
        recordings, unseen = load_train_and_test(runs, held, vehicle, columns)
        train, test = (recordings, unseen) if held else hold_out(recordings)
        keep = lambda diagnosis, improved: _keep(Answer(diagnosis, improved, None), fresh, out)
        answer = diagnosed(vehicle, train, test, (*vocabulary(), *own), manoeuvre, budget, keep, first)
        # shown before it is written: where writing fails, minutes of work are not lost
        answer.emit(explain)
        with fresh() as folder:
            answer.write(folder)
    terminal.note(f"report: {out / 'report.html'}")
    if not answer.diagnosis.complete and (watch := options().watch) is not None and watch.interrupted:
        options().kept = _held(answer, out)
        raise KeyboardInterrupt


def added(vehicle: AbstractVehicle, improved: Path, kinds: tuple[type[AbstractEffect], ...]) -> list[AbstractEffect]:
    """The effects of `kinds` that the vehicle file `improved` has more than a vehicle."""
    own = [kind for kind in kinds if kind not in vocabulary()]
    found = added_effects(read_vehicle(improved, own), vehicle, kinds)
    if not found:
        raise InputError(str(improved), "has no effect that the vehicle lacks", "leave out --begin")
    return found


def _keep(answer: "Answer", fresh: Fresh, out: Path) -> None:
    """Put an answer on the way at `out`. Where it cannot be written, the command says so with the last one."""
    with suppress(OutputError):
        with fresh() as folder:
            answer.write_numbers(folder)
        options().kept = _held(answer, out)


def _held(answer: "Answer", out: Path) -> str:
    return f"{out} holds the answer{'' if answer.diagnosis.complete else ' so far, which is incomplete'}"


@dataclasses.dataclass(frozen=True)
class Answer:
    """A diagnosis, the improved vehicle, and the inputs of the run that would tell rivals apart, if there are any."""

    diagnosis: Conclusions
    improved: AbstractVehicle
    next_run: Recording | None

    def emit(self, explain: bool = False) -> None:
        """Print the verdict, or with `--json` what `diagnosis.json` holds, on standard output."""
        terminal.emit(self.diagnosis.to_json(), lambda: show(self.diagnosis, explain))

    def write(self, folder: Path) -> None:
        """Write `diagnosis.json`, `improved.toml`, `report.html`, `figures/` and `next_manoeuvre.csv` into `folder`."""
        text = self.write_numbers(folder)
        if self.next_run is not None:
            save(self.next_run, folder / _NEXT)
        write_report(self.diagnosis, text, folder)

    def write_numbers(self, folder: Path) -> str:
        """Write `diagnosis.json` and `improved.toml` alone; returns the latter's text."""
        diagnosis = self.diagnosis
        improved = with_coefficients(self.improved)
        text = vehicle_text(improved, f"{diagnosis.vehicle}, improved by jaxsub\n{diagnosis.summary}")
        (folder / "improved.toml").write_text(text, encoding="utf-8")
        (folder / "diagnosis.json").write_text(to_json(diagnosis.to_json()), encoding="utf-8")
        return text


def diagnosed(
    vehicle: AbstractVehicle,
    train: Sequence[Recording],
    test: Sequence[Recording],
    kinds: tuple[type[AbstractEffect], ...] | None = None,
    manoeuvre: bool = True,
    budget: float | None = None,
    keep: Keep = lambda diagnosis, improved: None,
    begin: Sequence[AbstractEffect] = (),
) -> Answer:
    """Diagnose `vehicle` by the runs `train`, shown on `test`, trying effects of `kinds`: all installed where None.

    Where rivals remain and a `manoeuvre` is wanted, inputs that would tell them apart are looked for. After `budget`
    seconds, or once interrupted, no further effect is tried. Each answer on the way is given to `keep`. Effects to
    `begin` with come before any other.
    """
    watch = options().watch
    with terminal.progress(f"diagnosing {vehicle.layout.name}") as told, ExitStack() as kept:

        def keep_and_heed(diagnosis: Conclusions, improved: AbstractVehicle) -> None:
            keep(diagnosis, improved)
            # before there is an answer an interruption ends all at once
            if watch is not None:
                kept.enter_context(watch.heeded())

        stop = lambda: watch is not None and watch.interrupted
        diagnosis, improved = diagnose_runs(
            vehicle,
            train,
            test,
            vocabulary=kinds,
            progress=told,
            budget=budget,
            stop=stop,
            keep=keep_and_heed,
            begin=begin,
        )
        kept.close()
        if not (manoeuvre and diagnosis.explanations and diagnosis.complete):
            return Answer(diagnosis, improved, None)
        keep(diagnosis, improved)
        told("looking for the manoeuvre that would settle it")
        found = next_run(diagnosis, train)
        if found is None:
            return Answer(diagnosis, improved, None)
        advice = f"{diagnosis.next_manoeuvre}. {said(found, _NEXT)}"
        return Answer(dataclasses.replace(diagnosis, next_manoeuvre=advice), improved, found.recording)


def show(diagnosis: Conclusions, explain: bool = False) -> None:
    """The verdict, the effects that were named, and the errors on the test runs, on standard output.

    `explain` adds a row for every decision, in order.
    """
    terminal.results.print(
        Panel(
            Text(diagnosis.summary),
            title=diagnosis.verdict + ("" if diagnosis.complete else " (incomplete)"),
            expand=False,
        )
    )
    parameters = [
        (found.label, symbol, measurement(one.value, one.standard_error), unit(one.unit), percent(found.probability))
        for found in diagnosis.physics
        for symbol, one in found.parameters.items()
    ]
    if parameters:
        terminal.table(("effect", "parameter", "value", "unit", "probability of the effect"), parameters)
    before, after = (diagnosis.fit.get("held_out", {}).get(model, {}) for model in ("baseline", "improved"))
    if diagnosis.improves:
        rows = [(name, ratio(value), ratio(after.get(name))) for name, value in before.items()]
        terminal.table(("test run: channel", "rms/σ of the baseline", "of the improved model"), rows)
    elif before:
        rows = [(name, ratio(value)) for name, value in before.items()]
        terminal.table(("test run: channel", "rms/σ"), rows)
    if explain:
        terminal.table(("candidate", "test", "statistic", "threshold", "outcome"), decision_rows(diagnosis.decisions))
