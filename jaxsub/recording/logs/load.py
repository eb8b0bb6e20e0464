"""A log of any kind, by its suffix, as a list of channels or as a recording."""

import contextlib
import dataclasses
import os
from collections.abc import Callable, Collection, Iterator, Mapping
from pathlib import Path

import numpy as np

from ...errors import InputError
from ...findings import Finding
from ...units import TIME, UnknownUnit, column_unit, si_unit, split_header, to_si
from ..reading import note, reading, require_file
from ..recording import Recording
from .ardupilot import DataFlash, Telemetry
from .log import Listing, Log, Series, taken
from .mcap import McapLog
from .merge import merged
from .printed import printed
from .rosbag import RosBag
from .selection import Selection, Term
from .slocum import SlocumLog
from .ulog import ULog

_SLOCUM = [f".{kind}{form}d" for form in "bc" for kind in "destmn"]
_KINDS: dict[str, Callable[[Path], Log]] = {".ulg": ULog, ".mcap": McapLog, ".bag": RosBag, ".db3": RosBag}
_KINDS |= {".bin": DataFlash, ".tlog": Telemetry}
_KINDS |= dict.fromkeys(_SLOCUM, SlocumLog)
SUFFIXES = tuple(_KINDS)
_AXES = ("yaw", "pitch", "roll")


def contents(path: str | os.PathLike[str]) -> Listing:
    """What a log holds: each channel's name, unit where the log states one, and number of samples.

    Where the log is incomplete, a warning in the findings says what is lost. The kinds are PX4's .ulg, ArduPilot's
    .bin and .tlog, .mcap, .bag, .db3, a ROS 2 bag's folder, and Slocum's .dbd, .ebd, .sbd, .tbd, .mbd, .nbd. Raises
    InputError for a file that cannot be read, or whose reader (`pip install 'jaxsub[logs]'`) is not installed.
    """
    with _read(Path(path)) as (log, findings):
        listed = log.channels()
    return Listing(listed, tuple(findings))


def load_log(
    path: str | os.PathLike[str],
    selection: Selection | Mapping[str, str],
    *,
    held: Collection[str] = (),
    interpolated: Collection[str] = (),
) -> Recording:
    """The columns of `selection` in the log at `path` as one recording, named after the log.

    `held` columns are held between their samples and `interpolated` ones are joined by lines, as a vehicle takes its
    inputs and its prescribed motions; `merged` says how the rest finds its rows. What of the log is lost is a
    warning in the recording's findings. Raises InputError for a channel that the log does not hold, a unit that is
    none, and all that a recording is refused for.
    """
    path = Path(path)
    chosen = selection if isinstance(selection, Selection) else Selection(selection)
    terms = {header: chosen.term(header) for header in chosen.columns}
    with _read(path) as (log, findings):
        found = taken(log, str(path), sorted({t.channel for t in terms.values() if t.function not in _AXES}))
        turned = {c: _attitude(log, path, c) for c in {t.channel for t in terms.values() if t.function in _AXES}}
    columns: dict[str, Series] = {}
    for header, term in terms.items():
        name, unit = split_header(header)
        where = f"{chosen.source}, column {header!r}"
        if name in columns or name == TIME:
            raise InputError(where, "is there already", "give each column one line; a log brings its own times")
        source = turned[term.channel][term.function] if term.function in _AXES else found[term.channel]
        where = where if unit is not None else f"{path}, column {header!r}"
        columns[name] = _column(where, name, source, term, unit)
        if unit is None and source.unit and columns[name].unit == "":
            what = f"{chosen.columns[header]!r} is taken in {source.unit}, the unit that the log states"
            findings.append(note(str(path), "unit", what, name))
    span = {"every": chosen.every, "start": chosen.start, "end": chosen.end}
    run = merged(columns, path.stem, str(path), held=held, interpolated=interpolated, **span)
    units = {name: column.unit for name, column in columns.items() if column.unit}
    return dataclasses.replace(run, units=units, findings=(*findings, *run.findings))


def opened(path: Path) -> Log:
    """The log at `path`, by its suffix; a folder is a ROS 2 bag."""
    if not path.is_dir():
        require_file(path, "give the path of a log")
    kind = RosBag if path.is_dir() else _KINDS.get(path.suffix.lower())
    if kind is None:
        raise InputError(str(path), f"unknown extension {path.suffix!r}", f"logs are {', '.join(SUFFIXES)}")
    return kind(path)


@contextlib.contextmanager
def _read(path: Path) -> Iterator[tuple[Log, list[Finding]]]:
    """The log at `path` and, once it has been read, a warning where it is incomplete."""
    findings: list[Finding] = []
    with printed() as said, reading(str(path), "a log"):
        log = opened(path)
        yield log, findings
    if lost := [*log.losses, *said]:
        what = f"is incomplete: {'; '.join(lost)}; samples may be missing"
        findings.append(Finding("incomplete-log", "warning", str(path), what, "check that it was copied whole"))


def _column(where: str, name: str, series: Series, term: Term, unit: str | None) -> Series:
    """In SI, turned, scaled and shifted as `term` says; without a unit where a factor may change the log's own."""
    stated = column_unit(name, series.unit if unit is None else unit)
    try:
        si = (si_unit(stated) or "1") if stated else ""
        in_si = lambda values: to_si(values, stated) if stated else np.asarray(values, np.float64)
        one, none = in_si(np.array([1.0, 0.0]))
    except UnknownUnit as error:
        raise InputError(where, str(error), f"state the channel's unit as name[unit]; {error.remedy}") from error
    if term.function in _AXES and stated and (one, none) != (1.0, 0.0):
        raise InputError(where, f"{term.function}() is in rad, not {stated}", f"head it {name} or {name}[rad]")
    times, values = series.times, series.values
    if term.function == "unwrap":
        kept = ~np.isnan(values)
        times, values = times[kept], np.unwrap(in_si(values[kept]))
        values = term.factor * values + term.offset * (one - none)
    else:
        values = in_si(term.factor * values + term.offset)
    plain = unit is not None or (abs(term.factor) == 1.0 and term.offset == 0.0)
    return Series(times, values, si if plain else "")


def _attitude(log: Log, path: Path, name: str) -> dict[str, Series]:
    """Yaw, pitch and roll of a quaternion, rad, yaw without jumps of a turn."""
    forms = ([f"{name}[{index}]" for index in (1, 2, 3, 0)], [f"{name}.{part}" for part in "xyzw"])
    for form in forms:
        found = log.series(form)
        if len(found) == len(form):
            parts = np.stack([found[part].values for part in form], axis=1)
            good = np.isfinite(parts).all(axis=1) & (np.abs(parts) > 0.0).any(axis=1)
            from scipy.spatial.transform import Rotation

            angles = Rotation.from_quat(parts[good]).as_euler("ZYX")
            angles[:, 0] = np.unwrap(angles[:, 0])
            return {axis: Series(found[form[0]].times[good], angles[:, i], "rad") for i, axis in enumerate(_AXES)}
    remedy = f"it needs {forms[0][3]}, {forms[0][0]} and so on, or {forms[1][0]} to {forms[1][3]}"
    raise InputError(str(path), f"holds no quaternion {name!r}", remedy)
