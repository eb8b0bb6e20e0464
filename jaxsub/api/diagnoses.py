"""Diagnoses: which physics a vehicle lacks according to recordings, the improved vehicle, and the run to make next."""

import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, final

from ..checks.estimated_noise import HARDLY_FOLLOWED, hardly_followed
from ..discrepancy import Conclusions
from ..discrepancy import diagnose as conclude
from ..discrepancy.explain.next_run import next_run, sentence
from ..discrepancy.procedure import Keep
from ..discrepancy.records.decisions import decision_rows
from ..discrepancy.records.diagnosis import Coefficient, Location, Physics, Verdict
from ..discrepancy.records.progress import Progress
from ..discrepancy.records.stored import STORED, load_conclusions, save_conclusions
from ..effects import AbstractEffect
from ..errors import InputError
from ..estimate import require_free
from ..findings import Finding
from ..plain import to_json
from ..recording import Recording, hold_out, load, save
from ..recording.recording import Recordings
from ..report.text import measurement, percent, ratio, unit
from ..vehicle import AbstractVehicle, read_vehicle, vehicle_text, with_coefficients
from ..workers import working_on
from .recordings import checked
from .result import AbstractResult
from .table import Parts, Table

if TYPE_CHECKING:
    import pandas

    from ..report import Picture

IMPROVED, NEXT_RUN = "improved.toml", "next_manoeuvre.csv"


def diagnose(
    vehicle: AbstractVehicle,
    recordings: Recordings,
    held_out: Recordings | None = None,
    *,
    effects: Sequence[type[AbstractEffect]] | None = None,
    manoeuvre: bool = True,
    budget: float | None = None,
    cluster: str | None = None,
    progress: Progress = lambda message: None,
) -> "Diagnosis":
    """Which physics `vehicle` lacks according to `recordings`: what `jaxsub diagnose` computes.

    Candidates are fitted to `recordings`, one or several. They are checked as `js.check` does. `held_out` are the test
    runs, which are simulated once after the last decision; without them they are the last recording, or the last 30 %
    of a single one. `effects` are the classes that may be named, by default `js.vocabulary()`. Where rivals remain and
    a `manoeuvre` is wanted, inputs that separate them are looked for. After `budget` seconds no further effect is
    tried, and the answer so far is given. Passes over many runs are work of the Dask workers of `cluster`, the address
    of a scheduler, or `local` for a worker a core. `progress` is called with a line on what is being done.

    **Raises** `InputError` where nothing is free, for recordings that cannot be used, where the model does not run from
    its values or diverges along the recordings, and where no scheduler answers at `cluster`.
    """
    require_free(vehicle, vehicle.layout.name)
    runs = checked(vehicle, recordings, held_out or ())
    train, test = (runs.recordings, runs.held_out) if held_out else hold_out(runs.recordings)
    kinds = None if effects is None else tuple(effects)
    with working_on(cluster):
        found = diagnosed(vehicle, train, test, kinds, budget=budget, progress=progress)
    return found.with_next_run(train, progress) if manoeuvre else found


def diagnosed(
    vehicle: AbstractVehicle,
    train: Sequence[Recording],
    test: Sequence[Recording],
    kinds: tuple[type[AbstractEffect], ...] | None = None,
    *,
    budget: float | None = None,
    progress: Progress = lambda message: None,
    stop: Callable[[], bool] = lambda: False,
    keep: Callable[["Diagnosis"], object] = lambda found: None,
    begin: Sequence[AbstractEffect] = (),
) -> "Diagnosis":
    """The diagnosis of `vehicle` by checked runs, trying effects of `kinds`; arguments as of `discrepancy.diagnose`."""
    handed: Keep = lambda conclusions, improved: keep(Diagnosis(conclusions, improved))
    conclusions, improved = conclude(
        vehicle, train, test, vocabulary=kinds, progress=progress, budget=budget, stop=stop, keep=handed, begin=begin
    )
    return Diagnosis(_warned(conclusions, vehicle, train), improved)


def _warned(conclusions: Conclusions, vehicle: AbstractVehicle, train: Sequence[Recording]) -> Conclusions:
    """The same with a warning of channels that even the improved model hardly follows."""
    found = hardly_followed(vehicle, {channel.channel: channel.sigma for channel in conclusions.channels}, train)
    return dataclasses.replace(
        conclusions,
        notes=[*conclusions.notes, *(finding.line() for finding in found)],
        findings=(*conclusions.findings, *found),
    )


@final
@dataclasses.dataclass(frozen=True, repr=False, eq=False)
class Diagnosis(AbstractResult):
    """The answer to "what physics was left out".

    **Fields**

    - `conclusions`: verdict, effects and all that shows them, as the report has it.
    - `improved`: the vehicle with the accepted effects, fitted to the training runs.
    - `next_run`: inputs of the run that would tell rivals apart, where any remain and it was looked for.
    """

    conclusions: Conclusions
    improved: AbstractVehicle
    next_run: Recording | None = None

    @classmethod
    def load(cls, folder: str | Path, effects: Sequence[type[AbstractEffect]] = ()) -> "Diagnosis":
        """The diagnosis in `folder`, written by `save` or a command; `effects` are a user's own that it names.

        Arrays are in single precision, and the models of rivals are not kept: `with_next_run` adds nothing.

        **Raises** `InputError` where there is none, or one of another version.
        """
        place = Path(folder)
        conclusions, planned = load_conclusions(place / STORED), place / NEXT_RUN
        return cls(conclusions, read_vehicle(place / IMPROVED, effects), load(planned) if planned.exists() else None)

    @property
    def verdict(self) -> Verdict:
        """`none`, `named`, `ambiguous` or `unknown`."""
        return self.conclusions.verdict

    @property
    def sentence(self) -> str:
        """The verdict in words."""
        return self.conclusions.summary

    @property
    def physics(self) -> list[Physics]:
        """The accepted effects with their numbers and rivals, the strongest first."""
        return self.conclusions.physics

    @property
    def where(self) -> list[Location]:
        """The equations, actuators and sensors in which the mismatch lies, with shares and times."""
        return self.conclusions.where

    @property
    def coefficients(self) -> list[Coefficient]:
        """The free numbers before and after."""
        return self.conclusions.coefficients

    @property
    def rms(self) -> dict[str, dict[str, dict[str, float]]]:
        """rms(residual)/σ by `train` or `held_out`, by `baseline` or `improved`, and by channel."""
        return self.conclusions.fit

    @property
    def notes(self) -> list[str]:
        """What a reader must know besides."""
        return self.conclusions.notes

    @property
    def warnings(self) -> list[Finding]:
        """Channels that even the improved model hardly follows, so that the verdict says little."""
        return [finding for finding in self.conclusions.findings if finding.check == HARDLY_FOLLOWED]

    @property
    def complete(self) -> bool:
        """Whether all was tried: its time was not spent before."""
        return self.conclusions.complete

    @property
    def undecided(self) -> bool:
        """Whether rivals remain that a further run could tell apart."""
        return bool(self.conclusions.explanations) and self.complete

    def with_next_run(self, train: Sequence[Recording], progress: Progress = lambda message: None) -> "Diagnosis":
        """The same with the inputs that would separate rivals of the runs `train`, where any remain.

        `progress` is called with a line on what is being done.
        """
        if not self.undecided:
            return self
        progress("looking for the manoeuvre that would settle it")
        found = next_run(self.conclusions, train)
        if found is None:
            return self
        advice = f"{self.conclusions.next_manoeuvre}. {sentence(found, NEXT_RUN)}"
        advised = dataclasses.replace(self.conclusions, next_manoeuvre=advice)
        return dataclasses.replace(self, conclusions=advised, next_run=found.recording)

    def brief(self) -> Parts:
        """The verdict, the numbers of the effects, and the errors on the test runs."""
        incomplete = "" if self.complete else " (incomplete)"
        return [f"{self.verdict}{incomplete}: {self.sentence}", *self.tables()]

    def parts(self) -> Parts:
        """The same with notes, and what to record next."""
        more = self.conclusions.next_manoeuvre
        return [*self.brief(), *self.notes, *([more] if more else [])]

    def tables(self) -> list[Table]:
        """The numbers of the effects that were accepted, and the errors on the test runs."""
        made = self.conclusions
        parameters = [
            (f.label, symbol, measurement(one.value, one.standard_error), unit(one.unit), percent(f.probability))
            for f in made.physics
            for symbol, one in f.parameters.items()
        ]
        heads = ("effect", "parameter", "value", "unit", "probability of the effect")
        tables = [Table(heads, parameters)] if parameters else []
        before, after = (made.fit.get("held_out", {}).get(model, {}) for model in ("baseline", "improved"))
        if made.improves:
            rows = [(name, ratio(value), ratio(after.get(name))) for name, value in before.items()]
            tables.append(Table(("test run: channel", "rms/σ of the baseline", "of the improved model"), rows))
        elif before:
            tables.append(Table(("test run: channel", "rms/σ"), [(name, ratio(v)) for name, v in before.items()]))
        return tables

    def decisions(self) -> Table:
        """Every decision in order: candidate, test, statistic, threshold and outcome."""
        heads = ("candidate", "test", "statistic", "threshold", "outcome")
        return Table(heads, decision_rows(self.conclusions.decisions))

    def plot(self, name: str | None = None) -> "Picture":
        """A figure of the report: `residual`, `forces`, `by-state`, `scan`, `before-after`, `checks`, `coefficients`,
        `by-run`.

        Without a `name` it is the test run before and after, or the first there is.

        **Raises** `InputError` for a figure that this diagnosis has no data for.
        """
        from ..report import draw

        drawn = draw(self.conclusions)
        name = name or ("before-after" if "before-after" in drawn else next(iter(drawn), "before-after"))
        if name not in drawn:
            raise InputError("plot", f"there is no figure {name!r}", f"choose among {', '.join(drawn) or 'none'}")
        return drawn[name]

    def to_dataframe(self) -> "pandas.DataFrame":
        """A row for each number of an accepted effect, SI."""
        import pandas

        columns = ("effect", "parameter", "value", "standard_error", "unit", "probability")
        rows = [
            (found.label, symbol, one.value, one.standard_error, one.unit, found.probability)
            for found in self.physics
            for symbol, one in found.parameters.items()
        ]
        return pandas.DataFrame(rows, columns=list(columns))

    def write(self, folder: Path) -> None:
        """Write `diagnosis.json`, `improved.toml`, `report.html`, `figures/` and `next_manoeuvre.csv` into `folder`.

        `diagnosis.npz` beside them is what `jaxsub report` draws the page from again.
        """
        from ..report import write_report

        text = self.write_numbers(folder)
        if self.next_run is not None:
            save(self.next_run, folder / NEXT_RUN)
        save_conclusions(self.conclusions, folder / STORED)
        write_report(self.conclusions, text, folder)

    def write_numbers(self, folder: Path) -> str:
        """Write `diagnosis.json` and `improved.toml` alone into `folder`; returns the latter's text."""
        made = self.conclusions
        text = vehicle_text(with_coefficients(self.improved), f"{made.vehicle}, improved by jaxsub\n{made.summary}")
        (folder / IMPROVED).write_text(text, encoding="utf-8")
        (folder / "diagnosis.json").write_text(to_json(made.to_json()), encoding="utf-8")
        return text
