"""The readings of a suite's sensors from a file or a log, in SI and body or earth axes."""

import dataclasses
from pathlib import Path

import numpy as np

from ...errors import InputError
from ...findings import Finding
from ...recording import Recording, Selection, is_log, load_in_order, load_log
from ...units import same_dimension, to_si
from ...vehicle.sensors.earth import radii
from ...vehicle.sensors.water import depth_at
from .read import acceleration, check_unit
from .suite import KINDS, Sensor, SensorSuite

# signs and order that turn axes forward, port, up into forward, starboard, down, and east, north, up into NED
_FLU = np.array([1.0, -1.0, -1.0])
_QUARTER = 0.5 * np.pi
_GAUSS = 1e-4  # T
# the share of samples that repeat the one before, from which on a column is taken to be held between measurements
_HELD = 0.5


@dataclasses.dataclass(frozen=True)
class SensorLog:
    """Readings of sensors on one column of times.

    **Fields**

    - `times`: (K,) s. `readings`: by sensor's name (K, n), SI, in body axes or NED; NaN where it measured nothing.
    - `others`: columns of the file that no sensor has. `name`, `source`: of the file. `findings`: of its reading.
    - `origin`: latitude and longitude (rad) where x and y are zero, None where nothing says.
    """

    times: np.ndarray
    readings: dict[str, np.ndarray]
    others: dict[str, np.ndarray]
    name: str
    source: str
    findings: tuple[Finding, ...] = ()
    origin: tuple[float, float] | None = None

    def complete(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """Times (k,) and values (k, n) of a sensor's samples in which nothing is missing."""
        whole = np.all(np.isfinite(self.readings[name]), axis=1)
        return self.times[whole], self.readings[name][whole]


def interpolated(at: np.ndarray, times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """(k, n) values (m, n) of increasing `times` (m,), linear in between, at the times `at` (k,)."""
    return np.stack([np.interp(at, times, column) for column in values.T], axis=1)


def load_sensors(path: Path, suite: SensorSuite) -> SensorLog:
    """The readings that the file or log at `path` holds of a suite's sensors.

    **Raises** `InputError` for a file that cannot be read, and for a column that is absent, empty, or in a unit of
    another dimension.
    """
    if is_log(path):
        columns = {s.name: tuple(f"{s.name}_{c}" for c in s.channels) for s in suite.sensors}
        chosen = {column: text for s in suite.sensors for column, text in zip(columns[s.name], s.columns, strict=True)}
        inertial = [column for s in suite.of("gyro", "accelerometer") for column in columns[s.name]]
        recording = load_log(path, Selection(chosen, source=suite.source), interpolated=inertial)
    else:
        recording, columns = load_in_order(path), {sensor.name: sensor.columns for sensor in suite.sensors}
    return sensor_log(recording, suite, columns)


def sensor_log(
    recording: Recording, suite: SensorSuite, columns: dict[str, tuple[str, ...]] | None = None
) -> SensorLog:
    """The readings that a recording holds; `columns` by sensor's name where they are not the sensors' own."""
    found, findings, origin = {}, list(recording.findings), None
    for sensor in suite.sensors:
        names = sensor.columns if columns is None else columns[sensor.name]
        raw = np.stack([_si(recording, sensor, i, name) for i, name in enumerate(names)], axis=1)
        if not np.isfinite(raw).all(axis=1).any():
            where = f"{recording.source}, columns {', '.join(map(repr, names))}"
            raise InputError(where, "hold no complete sample", f"leave sensors.{sensor.name} out of {suite.source}")
        if sensor.kind not in ("gyro", "accelerometer"):
            raw, held = _without_repeats(raw)
            findings += [_held_finding(recording.source, sensor, held, len(raw))] if held else []
        if "latitude" in sensor.channels:
            origin = sensor.origin or origin or _first_fix(raw)
        found[sensor.name] = _in_axes(sensor, raw, origin)
    taken = {name for names in (columns or {s.name: s.columns for s in suite.sensors}).values() for name in names}
    others = {name: values for name, values in recording.columns.items() if name not in taken}
    return SensorLog(recording.times, found, others, recording.name, recording.source, tuple(findings), origin)


def _si(recording: Recording, sensor: Sensor, index: int, column: str) -> np.ndarray:
    """The samples of a sensor's column in SI; the sensor's unit counts where the file states none."""
    values, meant = recording.column(column), KINDS[sensor.kind].units[sensor.channels[index]]
    if column in recording.units and meant == "T":
        return values
    if column in recording.units:
        check_unit(f"{recording.source}, column {column!r}", recording.units[column], meant)
        return values
    if meant == "T" and same_dimension(sensor.unit[index], "gauss"):
        gauss = to_si(np.ones(1), sensor.unit[index]) / to_si(np.ones(1), "gauss")
        return values * _GAUSS * gauss
    return to_si(values, acceleration(sensor.unit[index], meant))


def _in_axes(sensor: Sensor, raw: np.ndarray, origin: tuple[float, float] | None) -> np.ndarray:
    """Readings (K, n) turned from the sensor's axes to the body's, or to north, east, down."""
    if sensor.frame == "FLU":
        raw = raw * _FLU
    if sensor.kind in ("gyro", "accelerometer", "magnetometer", "dvl"):
        return raw @ np.array(sensor.mounting).T
    if sensor.kind == "compass":
        return (_QUARTER - raw if sensor.frame == "ENU" else raw) + sensor.declination
    if sensor.kind == "pressure":
        return np.asarray(depth_at(raw - sensor.offset, sensor.density or 1000.0, sensor.latitude))
    if "latitude" in sensor.channels and origin is not None:
        local = (raw[:, :2] - np.array(origin)) * np.array(radii(origin[0]))
        return np.concatenate([local, -raw[:, 2:]], axis=1)
    if sensor.frame == "ENU":
        swapped = raw[:, [1, 0, *range(2, raw.shape[1])]]
        return swapped * np.array([1.0, 1.0, -1.0])[: raw.shape[1]]
    return raw


def _first_fix(raw: np.ndarray) -> tuple[float, float]:
    row = raw[np.isfinite(raw).all(axis=1)][0]
    return float(row[0]), float(row[1])


def _without_repeats(raw: np.ndarray) -> tuple[np.ndarray, int]:
    """Readings of which one that repeats the one before is missing, where most do: one measurement counts once."""
    whole = np.flatnonzero(np.isfinite(raw).all(axis=1))
    same = np.zeros(len(whole), bool)
    same[1:] = (raw[whole[1:]] == raw[whole[:-1]]).all(axis=1)
    if same.mean() <= _HELD:
        return raw, 0
    kept = raw.copy()
    kept[whole[same]] = np.nan
    return kept, int(same.sum())


def _held_finding(source: str, sensor: Sensor, held: int, rows: int) -> Finding:
    what = f"{held} of {rows} samples repeat the one before; each measurement is used once"
    return Finding("held-samples", "note", source, what, channel=", ".join(sensor.columns), count=held)
