"""The samples of one run, in SI units, with every defect that would mislead a fit refused at the door."""

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from jaxsub.errors import InputError, nearest
from jaxsub.findings import Finding
from jaxsub.units import TIME, UnknownUnit, check_time_unit, column_unit, from_si, si_unit

FIRST_ROW = 2  # in a file the header is row 1
_LISTED = 5  # further rows of an error
_GAP = 1.5  # usual intervals that a gap is longer than


@dataclass(frozen=True, eq=False, repr=False)
class Recording:
    """One run: float64 SI samples on strictly increasing times, NaN for a missing sample.

    **Fields**

    - `times`: (samples,) s. `columns`: (samples,) SI, by name. The arrays are read-only copies.
    - `source`: the file or process that made the run; `first_row`: that of its first sample there.
    - `units`: the SI unit of each column whose file states one.
    - `unusable`: the error of each column that holds no numbers or has a unit that is none, raised when it is used.
    - `findings`: what reading and checking found.

    **Raises** `InputError` for fewer than two samples, a time that is not finite or not later than the one before, an
    infinite sample, columns of unequal length, or a name that a file header could not hold.
    """

    name: str
    times: np.ndarray
    columns: dict[str, np.ndarray]
    source: str
    first_row: int = FIRST_ROW
    units: Mapping[str, str] = field(default_factory=dict)
    unusable: Mapping[str, InputError] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()

    def __post_init__(self):
        object.__setattr__(self, "times", _read_only(self.times))
        object.__setattr__(self, "columns", {name: _read_only(values) for name, values in self.columns.items()})
        self._check_times()
        for name, values in self.columns.items():
            check_column(self.source, self.first_row, self.times, name, values)

    def __repr__(self) -> str:
        steps = np.diff(self.times)
        usual = float(np.median(steps))
        late = steps[steps > _GAP * usual]
        gaps = f"{late.size} longer, up to {late.max():.3g} s" if late.size else "no gaps"
        length = f"{len(self.times)} samples, {self.duration:.6g} s, every {usual:.3g} s, {gaps}"
        columns = ", ".join(self._described(name) for name in self.columns) or "none"
        unusable = f"; unusable: {', '.join(self.unusable)}" if self.unusable else ""
        return f"Recording {self.name!r} from {self.source}: {length}\ncolumns: {columns}{unusable}"

    def _described(self, name: str) -> str:
        missing = int(np.count_nonzero(np.isnan(self.columns[name])))
        unit = f" [{self.units[name]}]" if name in self.units else ""
        return f"{name}{unit}" + (f" ({missing} missing)" if missing else "")

    @property
    def duration(self) -> float:
        """Time from the first to the last sample, s."""
        return float(self.times[-1]) - float(self.times[0])

    def column(self, name: str) -> np.ndarray:
        """The samples of the column `name`, (samples,), SI. Raises InputError for one that is absent or unusable."""
        if name in self.columns:
            return self.columns[name]
        if name in self.unusable:
            raise self.unusable[name]
        close = nearest(name, self.columns)
        remedy = f"did you mean {close!r}?" if close else f"its columns are {', '.join(self.columns) or 'none'}"
        raise InputError(self.source, f"has no column {name!r}", remedy)

    def inputs(self, names: Sequence[str]) -> np.ndarray:
        """Return input columns side by side, (samples, len(names)).

        Raises InputError when a column is absent or has a gap, since an input acts between the rows too.
        """
        table = np.empty((len(self.times), len(names)))
        for index, name in enumerate(names):
            table[:, index] = self.column(name)
            if (row := self._first(np.isnan(table[:, index]))) is not None:
                where = f"{self.source}, row {row}, column {name!r}"
                raise InputError(where, "a gap in an input column", "fill it in or cut the run there")
        return table

    def between(self, start: float, end: float) -> "Recording":
        """Return the samples with start <= time <= end, s. Raises InputError when fewer than two are left."""
        return self.select((self.times >= start) & (self.times <= end))

    def select(self, keep: np.ndarray) -> "Recording":
        """Return the consecutive samples where `keep` (samples,) is true. Raises InputError for fewer than two."""
        columns = {name: values[keep] for name, values in self.columns.items()}
        first_row = self.first_row + int(np.argmax(keep))
        return replace(self, times=self.times[keep], columns=columns, first_row=first_row)

    def resample(self, times: np.ndarray, held: Collection[str] = ()) -> "Recording":
        """Return the run at other `times` (samples,), s: linear between samples, but constant for the `held` columns.

        A sample next to a missing one, or outside the run, is missing; a held column lasts beyond the end of the run.
        Raises InputError when a held column is absent or the times are not increasing.
        """
        for name in held:
            self.column(name)
        columns = {
            name: self._hold(values, times) if name in held else self._interpolate(values, times)
            for name, values in self.columns.items()
        }
        source = f"{self.source} (resampled)"
        return replace(self, times=times, columns=columns, source=source, first_row=FIRST_ROW)

    def in_units(self, units: Mapping[str, str]) -> dict[str, np.ndarray]:
        """Return times and columns as a file holds them, headed `name[unit]` where `units` gives one, else `name`.

        Raises InputError for an absent column, an unknown unit, and a unit of another dimension than the file's, or of
        `t` than time.
        """
        samples = {TIME: self.times, **self.columns}
        headed = {name: f"{name}[{units[name]}]" if name in units else name for name in samples}
        for name, unit in units.items():
            where = f"{self.source}, column {name!r}"
            try:
                if name == TIME:
                    check_time_unit(where, unit)
                    samples[name] = from_si(self.times, unit)
                    continue
                meant = column_unit(name, unit)
                si = si_unit(meant) or "1"
                if (stated := self.units.get(name, si)) != si:
                    raise InputError(where, f"is in {stated}, which {unit!r} is no unit of", f"write it in {stated}")
                samples[name] = from_si(self.column(name), meant)
            except UnknownUnit as error:
                raise InputError(where, str(error), error.remedy) from error
        return {headed[name]: values for name, values in samples.items()}

    def _hold(self, values: np.ndarray, times: np.ndarray) -> np.ndarray:
        before = np.searchsorted(self.times, times, side="right") - 1
        return np.where(before >= 0, values[before], np.nan)

    def _interpolate(self, values: np.ndarray, times: np.ndarray) -> np.ndarray:
        return np.interp(times, self.times, values, left=np.nan, right=np.nan)

    def _first(self, bad: np.ndarray) -> int | None:
        return self.first_row + int(np.argmax(bad)) if bad.any() else None

    def _check_times(self) -> None:
        times = self.times
        if times.ndim != 1 or times.size < 2:
            raise InputError(self.source, f"has {times.size} samples", "a recording needs at least two")
        if (row := self._first(~np.isfinite(times))) is not None:
            raise InputError(f"{self.source}, row {row}", "the time is missing or not finite", "give every row a time")
        # of times that lie further apart than any number the step is infinite
        with np.errstate(over="ignore"):
            steps = np.diff(times)
        if (steps <= 0.0).any():
            raise self._disorder(steps)

    def _disorder(self, steps: np.ndarray) -> InputError:
        """The error of rows whose times do not increase: the first in full, all counted, some more listed."""
        wrong = np.flatnonzero(steps <= 0.0)
        first = int(wrong[0])
        what = f"time {self.times[first + 1]} s does not come after {self.times[first]} s"
        if wrong.size > 1:
            repeated = int(np.count_nonzero(steps[wrong] == 0.0))
            listed = ", ".join(str(self.first_row + 1 + int(row)) for row in wrong[1 : 1 + _LISTED])
            more = f" and {wrong.size - 1 - _LISTED} more" if wrong.size > 1 + _LISTED else ""
            what += (
                f"; of {wrong.size} such rows {repeated} repeat the time before and {wrong.size - repeated} go back:"
                f" also rows {listed}{more}"
            )
        where = f"{self.source}, row {self.first_row + 1 + first}"
        return InputError(where, what, "times must increase from row to row")


def check_column(source: str, first_row: int, times: np.ndarray, name: str, values: np.ndarray) -> None:
    """Raise InputError for a column of a run that has another length than its `times`, or an infinite sample.

    A name that a file's header could not hold is refused as well.
    """
    where = f"{source}, column {name!r}"
    if name == TIME or not re.fullmatch(r"[^\s\[\]]([^\[\]]*[^\s\[\]])?", name):
        raise InputError(where, "cannot be a column name", "head a column name or name[unit]")
    if values.shape != times.shape:
        what = f"has shape {values.shape} beside {times.size} times"
        raise InputError(where, what, "give one sample for each time")
    if (infinite := np.isinf(values)).any():
        where = f"{source}, row {first_row + int(np.argmax(infinite))}, column {name!r}"
        raise InputError(where, "an infinite sample", "leave the cell blank if it is missing")


def _read_only(values: np.ndarray) -> np.ndarray:
    copy = np.array(values, np.float64)
    copy.setflags(write=False)
    return copy


# what functions take that work on one run or on several
Recordings = Recording | Sequence[Recording]


def listed(recordings: Recordings) -> list[Recording]:
    """The recordings, one of them too, as a list."""
    return [recordings] if isinstance(recordings, Recording) else list(recordings)
