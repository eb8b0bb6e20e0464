"""A first sensor file from the names of a log's columns."""

import re
import tomllib
from collections.abc import Sequence

from ...errors import InputError
from ...recording.logs.log import Channel
from ...units import UnknownUnit, same_dimension
from .read import acceleration, sensors_from
from .suite import KINDS

# what follows each other in the names of a sensor's columns
_AXES = (("x", "y", "z"), ("X", "Y", "Z"), ("[0]", "[1]", "[2]"), ("p", "q", "r"), ("u", "v", "w"))
_TRIADS = {
    "gyro": r"gyr|angular_?(velocity|rate)|omega|(^|\W)g_?[xyz]$|(^|\W)p$",
    "accelerometer": r"acc|specific_force|(^|\W)[af]_?[xyz]$",
    "magnetometer": r"mag|(^|\W)m_?[xyz]$",
    "dvl": r"dvl|doppler|bottom_?(track|velocity)|(^|\W)u$",
}
_SINGLE = {
    "pressure": r"press", "depth": r"depth", "compass": r"heading|compass|(^|\W)(psi|yaw)$",
}  # fmt: skip
_FIX = (r"(^|[^a-z])lat(itude)?($|[^a-z])", r"(^|[^a-z])lon(gitude|g)?($|[^a-z])")
_ABOUT = {
    "gyro": 'grade = "consumer"                   # or industrial, tactical; or its numbers',
    "accelerometer": 'grade = "consumer"',
    "magnetometer": 'delay = "estimate"                   # s; or a number',
}


def initial_sensors(listed: Sequence[Channel], source: str) -> str:
    """The text of a sensor file of the channels that a log holds, by their names and units.

    **Raises** `InputError` where no three of them look like those of gyros or accelerometers.
    """
    units = {channel.name: channel.unit for channel in listed if channel.samples}
    found = {kind: _triad(kind, pattern, units) for kind, pattern in _TRIADS.items()}
    for kind in ("gyro", "accelerometer"):
        if not found[kind]:
            what = f"has no three columns that look like those of a {kind} ({', '.join(units) or 'it has none'})"
            raise InputError(source, what, f"write [sensors.{kind}] by hand, with column = [three names]")
    found |= {kind: _first(kind, pattern, units) for kind, pattern in _SINGLE.items()}
    if found["pressure"]:
        found["depth"] = ()
    fix = [next((name for name in units if re.search(pattern, name.lower())), "") for pattern in _FIX]
    found["gps"] = tuple(fix) if all(fix) else ()
    lines = [
        f"# sensors of {source}, by the names of its columns: see whether axes, units and noise are so",
        "schema = 1",
        'rule = "constant"                    # of the process noise; or consistent, fuzzy, sage-husa, innovation',
    ]
    if not any(columns for kind, columns in found.items() if kind not in ("gyro", "accelerometer")):
        lines += ["[motion]", "reach = 1.0                          # m: how far it goes about where it begins"]
    for kind, columns in found.items():
        if columns:
            lines += _table(kind, columns, units)
    text = "\n".join(lines) + "\n"
    sensors_from(tomllib.loads(text), source)
    return text


def _triad(kind: str, pattern: str, units: dict[str, str]) -> tuple[str, ...]:
    """The first three columns of one name but for the axis that look like those of a `kind`."""
    for name in units:
        if re.search(pattern, name, re.IGNORECASE):
            for axes in _AXES:
                head, axis, tail = name.rpartition(axes[0])
                columns = tuple(f"{head}{one}{tail}" for one in axes)
                if axis and all(column in units and _fits(kind, units[column]) for column in columns):
                    return columns
    return ()


def _first(kind: str, pattern: str, units: dict[str, str]) -> tuple[str, ...]:
    named = (name for name in units if re.search(pattern, name, re.IGNORECASE) and _fits(kind, units[name]))
    return tuple(list(named)[:1])


def _fits(kind: str, unit: str) -> bool:
    """Whether a unit, if one is stated, is one of what a `kind` measures."""
    meant = next(iter(KINDS[kind].units.values()))
    try:
        return not unit or meant == "T" or same_dimension(acceleration(unit, meant), meant)
    except UnknownUnit:
        return False


def _table(kind: str, columns: tuple[str, ...], units: dict[str, str]) -> list[str]:
    """The lines of a sensor's table."""
    known = KINDS[kind]
    fitting = [channels for channels in known.channels if len(channels) == len(columns)]
    first = fitting[0][0]
    listed = ", ".join(map(_quoted, columns))
    lines = ["", f"[sensors.{kind}]", f"column = {f'[{listed}]' if len(columns) > 1 else listed}"]
    if len(fitting) > 1:
        lines.append(f"channel = [{', '.join(map(_quoted, fitting[0]))}]")
    if not any(units[column] for column in columns):
        lines.append(f'unit = "{known.units[first]}"'.ljust(37) + "# the log states none")
    if known.frames:
        lines.append(f'frame = "{known.frames[0]}"'.ljust(37) + f"# or {', '.join(known.frames[1:])}")
    if kind in ("gyro", "accelerometer", "magnetometer", "dvl"):
        lines.append('mounting = ["x", "y", "z"]'.ljust(37) + "# where its axes point, or roll, pitch, yaw in rad")
    if "lever_arm" in known.keys:
        lines.append("lever_arm = [0.0, 0.0, 0.0]".ljust(37) + "# m, from the origin of the body's axes")
    if kind in _ABOUT:
        lines.append(_ABOUT[kind])
    else:
        about = f"# standard deviation of the noise, {known.units[first]}"
        lines.append(f"sigma = {known.sigma[first]:g}".ljust(37) + about)
    return lines


def _quoted(name: str) -> str:
    return '"' + name.replace("\\", "\\\\").replace('"', '\\"') + '"'
