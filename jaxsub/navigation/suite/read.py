"""Sensor files in: TOML to a `SensorSuite`."""

import dataclasses
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError
from ...units import UnknownUnit, same_dimension
from ...vehicle.kinematics import rotation
from ...vehicle.schema import Table, read_finite, read_positive
from ...vehicle.sensors.read import read_latitude, read_origin, refuse_two_densities
from ...vehicle.toml import check_tree, read_toml
from .grades import GRADES, Grade
from .suite import KINDS, RULES, Kind, Motion, Sensor, SensorSuite, Vector

_EVERY = ("kind", "column", "channel", "unit", "frame")
_MOST = 50
_CALIBRATIONS = ("none", "hard-iron", "soft-iron")
_SAMPLINGS = ("point", "mean")
# s, standard deviation of a delay that is to be estimated
_DELAY_STD = 0.1
_HALF_TURN = math.pi
_DENSEST = 2000.0  # kg/m³


def read_sensors(path: str | Path) -> SensorSuite:
    """The sensors in the file at `path`.

    **Raises** `InputError` that names the file and the key for anything that is not as the guide's page has it.
    """
    return sensors_from(read_toml(Path(path)), str(path))


def sensors_from(data: dict[str, Any], where: str) -> SensorSuite:
    """The sensors described by a parsed file; `where` names it in errors."""
    check_tree(data, where)
    top = Table(data, where, "")
    if type(top.required("schema")) is not int or data["schema"] != 1:
        raise InputError(f"{where}: schema", f"is {data['schema']!r:.60}", "this version reads schema = 1")
    top.only(("schema", "name", "rule", "motion", "sensors"))
    name = top.word("name") if "name" in data else Path(where).stem
    rule = top.choice("rule", RULES) if "rule" in data else RULES[0]
    tables = top.table("sensors")
    if len(tables.data) > _MOST:
        raise InputError(f"{where}: sensors", f"are {len(tables.data)}", f"give {_MOST} at most")
    sensors = tuple(_sensor(tables.table(key), key) for key in tables.data)
    for kind in ("gyro", "accelerometer"):
        if (count := sum(sensor.kind == kind for sensor in sensors)) != 1:
            what = f"has {count} sensors of the kind {kind}"
            raise InputError(f"{where}: sensors", what, f'give one [sensors.{kind}] with column = ["…", "…", "…"]')
    _refuse_shared_columns(sensors, where)
    suite = SensorSuite(name, sensors, rule, _motion(top.table("motion")), where)
    if not suite.aiding and suite.motion == Motion():
        what = "are a gyro and an accelerometer alone, whose errors grow without bound"
        raise InputError(f"{where}: sensors", what, "add another sensor, or [motion] with reach = … or speed = …")
    return suite


def _sensor(table: Table, name: str) -> Sensor:
    kind = table.choice("kind", tuple(KINDS)) if "kind" in table.data else name
    if kind not in KINDS:
        raise InputError(table.place("kind"), "is missing", f'write kind = "…", one of {", ".join(KINDS)}')
    known = KINDS[kind]
    table.only((*_EVERY, *known.keys))
    columns = _columns(table)
    channels = _channels(table, known, len(columns))
    given: dict[str, Any] = {"frame": _frame(table, known)}
    own = [key for key in known.keys if key in table.data and not (kind in GRADES and key in Grade._fields)]
    given |= {key: _READERS[key](table, key) for key in own if key in _READERS}
    if "delay" in given:
        given["delay"], given["delay_std"] = given["delay"]
    given["sigma"] = _sigma(table, known, channels)
    if kind in GRADES:
        given["noise"] = _noise(table, kind)
    if kind == "pressure":
        refuse_two_densities(table)
    if kind == "range":
        table.required("beacon")
    return Sensor(name, kind, channels, columns, _units(table, known, channels), **given)


def _columns(table: Table) -> tuple[str, ...]:
    entry = table.required("column")
    columns = [entry] if isinstance(entry, str) else entry
    if not isinstance(columns, list) or not columns or not all(isinstance(c, str) and c.strip() for c in columns):
        raise InputError(table.place("column"), f"{entry!r:.60} names no columns", 'write column = ["…", "…", "…"]')
    return tuple(columns)


def _channels(table: Table, known: Kind, count: int) -> tuple[str, ...]:
    if "channel" not in table.data:
        fitting = [channels for channels in known.channels if len(channels) == count]
        if len(fitting) == 1:
            return fitting[0]
        if fitting:
            # degrees that are read as metres, or metres as radians, are numbers as good as any
            what = f"is missing, and {count} columns may be {_listed(fitting)}"
            raise InputError(table.place("channel"), what, "write which of them")
        wanted = " or ".join(str(len(channels)) for channels in {len(c): c for c in known.channels}.values())
        raise InputError(table.place("column"), f"has {count} entries", f"give {wanted}")
    word = table.data["channel"]
    channels = (word,) if isinstance(word, str) else table.names("channel") or ()
    if channels not in known.channels:
        raise InputError(table.place("channel"), f"is {word!r:.60}", f"give {_listed(known.channels)}")
    if len(channels) != count:
        raise InputError(table.place("column"), f"has {count} entries", f"give {len(channels)}, one for each channel")
    return channels


def _listed(choices: Sequence[tuple[str, ...]]) -> str:
    return " or ".join(f"[{', '.join(channels)}]" for channels in choices)


def _units(table: Table, known: Kind, channels: tuple[str, ...]) -> tuple[str, ...]:
    """The unit of each column, which a log that states one has in place of it."""
    usual = tuple(known.units[channel] for channel in channels)
    if "unit" not in table.data:
        return usual
    entry, place = table.data["unit"], table.place("unit")
    units = [entry] * len(channels) if isinstance(entry, str) else entry
    if not isinstance(units, list) or len(units) != len(channels) or not all(isinstance(unit, str) for unit in units):
        raise InputError(place, f"{entry!r:.60} is no unit", f'write unit = "{usual[0]}", or a list of {len(channels)}')
    for unit, channel in zip(units, channels, strict=True):
        check_unit(place, unit, known.units[channel])
    return tuple(units)


def check_unit(place: str, unit: str, meant: str) -> None:
    """Refuse a unit that is none, or of another dimension than the one `meant`; a field may have none."""
    try:
        # of a field the direction matters, and its strength beside itself
        meanings = ("T", "gauss", "1") if meant == "T" else (meant,)
        fits = any(same_dimension(acceleration(unit, meant), meaning) for meaning in meanings)
    except UnknownUnit as error:
        raise InputError(place, str(error), error.remedy) from error
    if not fits:
        raise InputError(place, f"is {unit!r}, and the sensor measures {meant}", f"give a unit of {meant}")


def acceleration(unit: str, meant: str) -> str:
    """What `unit` means where an acceleration is `meant`: `g` is standard gravity and no gram."""
    return {"g": "g_n", "G": "g_n", "mg": "mg_n", "mG": "mg_n"}.get(unit.strip(), unit) if meant == "m/s^2" else unit


def _frame(table: Table, known: Kind) -> str:
    if not known.frames:
        if "frame" in table.data:
            raise InputError(table.place("frame"), "is of a sensor without axes", "delete it")
        return ""
    return table.choice("frame", known.frames) if "frame" in table.data else known.frames[0]


def _noise(table: Table, kind: str) -> Grade:
    grades = GRADES[kind]
    grade = grades[table.choice("grade", tuple(grades))] if "grade" in table.data else next(iter(grades.values()))
    given = {key: _not_negative(table, key) for key in Grade._fields if key in table.data}
    if given.get("density") == 0.0:
        raise InputError(table.place("density"), "is 0", "give a positive number; every sensor has noise")
    return grade._replace(**given)


def _sigma(table: Table, known: Kind, channels: tuple[str, ...]) -> tuple[float, ...]:
    if "sigma" not in table.data:
        return tuple(known.sigma.get(channel, 0.0) for channel in channels)
    entry, place = table.data["sigma"], table.place("sigma")
    sigmas = entry if isinstance(entry, list) else [entry] * len(channels)
    if len(sigmas) != len(channels):
        raise InputError(place, f"has {len(sigmas)} entries", f"give one, or {len(channels)}")
    return tuple(read_positive(sigma, place) for sigma in sigmas)


def _delay(table: Table, key: str) -> tuple[float, float]:
    """The delay and its standard deviation: a number, `"estimate"`, or `{ value = …, prior_std = … }`."""
    entry = table.data[key]
    if entry == "estimate":
        return 0.0, _DELAY_STD
    if isinstance(entry, dict):
        own = table.table(key)
        own.only(("value", "prior_std"))
        std = read_positive(own.required("prior_std"), own.place("prior_std"))
        return read_finite(own.data.get("value", 0.0), own.place("value")), std
    return read_finite(entry, table.place(key)), 0.0


def _mounting(table: Table, key: str) -> tuple[Vector, Vector, Vector]:
    """Rows of the rotation to the body's axes: from three angles in rad, or from the axes' names."""
    entry, place = table.data[key], table.place(key)
    remedy = 'give the angles of roll, pitch and yaw in rad, or where its axes point, such as ["x", "-y", "-z"]'
    if not isinstance(entry, list) or len(entry) != 3:
        raise InputError(place, f"is {entry!r:.60}", remedy)
    if all(isinstance(item, str) for item in entry):
        signs = {sign + axis: (1.0 if sign != "-" else -1.0) * np.eye(3)["xyz".index(axis)]
                 for sign in ("", "+", "-") for axis in "xyz"}  # fmt: skip
        if any(item not in signs for item in entry):
            raise InputError(place, f"is {entry!r:.60}", remedy)
        R = np.stack([signs[item] for item in entry], axis=1)
    else:
        R = rotation(*(np.asarray(read_finite(item, place)) for item in entry))
    if not np.isclose(np.linalg.det(R), 1.0):
        raise InputError(place, f"{entry!r:.60} is no rotation", "turn the axes, and mirror none")
    first, second, third = (tuple(row) for row in R.tolist())
    return first, second, third


def _vector(table: Table, key: str) -> Vector:
    entry = table.data[key]
    if not isinstance(entry, list) or len(entry) != 3:
        raise InputError(table.place(key), f"is {entry!r:.60}", "give three numbers in m")
    x, y, z = (read_finite(item, table.place(key)) for item in entry)
    return x, y, z


def _declination(table: Table, key: str) -> float:
    if abs(angle := read_finite(table.data[key], table.place(key))) > _HALF_TURN:
        raise InputError(table.place(key), f"is {angle:g}", "give an angle in rad")
    return angle


def _water(table: Table, key: str) -> float:
    if (density := read_positive(table.data[key], table.place(key))) > _DENSEST:
        raise InputError(table.place(key), f"is {density:g}", "give the water's density in kg/m³")
    return density


def _not_negative(table: Table, key: str) -> float:
    if (size := read_finite(table.data[key], table.place(key))) < 0.0:
        raise InputError(table.place(key), f"is {size:g}", "give a number that is not negative")
    return size


def _positive(table: Table, key: str) -> float:
    return read_positive(table.data[key], table.place(key))


_READERS: dict[str, Callable[[Table, str], Any]] = {
    "mounting": _mounting, "lever_arm": _vector, "correlation": _not_negative, "delay": _delay, "rate": _positive,
    "range": _positive, "declination": _declination, "density": _water, "beacon": _vector,
    "sampling": lambda table, key: table.choice(key, _SAMPLINGS),
    "calibration": lambda table, key: table.choice(key, _CALIBRATIONS),
    "latitude": lambda table, key: read_latitude(table.data[key], table.place(key)),
    "origin": lambda table, key: read_origin(table.data[key], table.place(key)),
    "offset": lambda table, key: read_finite(table.data[key], table.place(key)),
}  # fmt: skip


def _motion(table: Table) -> Motion:
    names = tuple(field.name for field in dataclasses.fields(Motion))
    table.only(names)
    return Motion(**{name: _positive(table, name) for name in names if name in table.data})


def _refuse_shared_columns(sensors: tuple[Sensor, ...], where: str) -> None:
    """Refuse a column that two sensors have: its noise would count twice."""
    taken: dict[str, str] = {}
    for sensor in sensors:
        for column in sensor.columns:
            if column in taken:
                place = f"{where}: sensors.{sensor.name}.column"
                raise InputError(place, f"{column!r} is a column of {taken[column]} too", "name each column once")
            taken[column] = sensor.name
