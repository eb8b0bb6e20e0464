"""`[outputs]` tables in, and the columns of `[inputs]` and `[prescribed]`."""

import dataclasses
import math
from typing import Any

from ...effects import CHANNEL_UNITS
from ...effects.derivatives import INPUT_UNITS
from ...errors import InputError
from ...parameters import Parameter
from ...units import same_dimension
from ..actuators.keys import Vector
from ..schema import Table, read_column, read_finite, read_positive, read_unit
from ..ties import Tie, is_tied, read_entry
from .keys import check_channels, check_keys
from .output import FRAMES, RAW_UNITS, STILL, WRAPS, Output, channel_unit
from .sensors import MOUNTING

_MOST = 200
_QUARTER = 0.5 * math.pi


@dataclasses.dataclass
class Reading:
    """What a file says of measured and of corrected columns, gathered table by table.

    **Fields**

    - `outputs`: the measured columns. `numbers`: value and row of each scale, offset and angle. `ties`: those that
      follow others.
    """

    outputs: list[Output] = dataclasses.field(default_factory=list)
    numbers: dict[str, tuple[float, Parameter]] = dataclasses.field(default_factory=dict)
    ties: list[Tie] = dataclasses.field(default_factory=list)

    def number(self, name: str, entry: Any, place: str, unit: str, section: str) -> None:
        """Add the number `name` as the file has it, fixed where it does not say."""
        row = Parameter(name, unit, free=False)
        self.numbers[name] = read_entry(name, entry, place, row, section, self.ties)

    def line(
        self, table: Table, name: str, channel: str, units: tuple[str, str], entries: dict[str, Any], section: str
    ) -> None:
        """Add scale and offset of a column that shows `channel`; `units` are the recorded one and the true one."""
        if channel == "psi" and "scale" in entries:
            raise InputError(table.place("scale"), "is of a heading, whose turns have one size", "delete it")
        recorded, true = units
        for key, entry in entries.items():
            unit = recorded if key == "offset" else _ratio(recorded, true)
            self.number(f"{name}.{key}", entry, table.place(key), unit, section)
            if key == "scale" and self.numbers[f"{name}.{key}"][0] == 0.0 and not is_tied(entry):
                raise InputError(table.place(key), "is 0", "give what one of the channel's unit is in the column")


def read_outputs(table: Table, channels: tuple[str, ...], body: bool, found: Reading) -> None:
    """The measured columns of `[outputs.*]`, into `found`; of what is no body there are those `channels`.

    **Raises** `InputError` for a key that its channel has not, a channel that there is not, two outputs of one name or
    column, and units that do not go together.
    """
    known = (*CHANNEL_UNITS, *RAW_UNITS) if body else channels
    if not table.data:
        raise InputError(f"{table.where}: outputs", "names no measured channel", "add [outputs.r] and the like")
    if len(table.data) > _MOST:
        raise InputError(f"{table.where}: outputs", f"are {len(table.data)}", f"give {_MOST} at most")
    for name in table.data:
        _read(table.table(name), name, known, body, found)
    for key in ("name", "column"):
        values = [getattr(output, key) for output in found.outputs]
        for index, output in enumerate(found.outputs):
            if (value := values[index]) in values[:index]:
                place = f"{table.where}: outputs.{output.table}"
                raise InputError(place, f"has the {key} {value} of another output", f"give it another {key}")


def _read(table: Table, name: str, known: tuple[str, ...], body: bool, found: Reading) -> None:
    channels, several = _channels(table, name)
    if "channel" in table.data and (not name.isidentifier() or (name in known and channels != (name,))):
        what = "is not a word" if not name.isidentifier() else "is the name of another channel"
        raise InputError(f"{table.where}: {table.section}", what, "give the output another name")
    check_channels(table, channels, known)
    check_keys(table, channels, body)
    directions = _directions(table)
    if directions:
        channels, several = ("beam",) * len(directions), True
    names = [f"{name}_{i if directions else c}" for i, c in enumerate(channels, 1)] if several else [name]
    share = lambda key, default: _shared(table, key, default, len(names), several)
    columns, sigmas = share("column", None), share("sigma", "estimate")
    lines = {key: share(key, None) for key in ("scale", "offset") if key in table.data}
    unit = _unit(table, channels[0], body)
    _mounting(table, name, found)
    for i, (own, channel) in enumerate(zip(names, channels, strict=True)):
        output = Output(
            channel,
            _sigma(sigmas[i], table.place("sigma")),
            _arm(table),
            own,
            own if columns[i] is None else read_column(columns[i], table.place("column"), own),
            unit,
            _frame(table, channel),
            table.choice("wrap", tuple(WRAPS)) if "wrap" in table.data else "",
            name if several else "",
            directions[i] if directions else STILL,
            *_water(table),
            read_origin(table.data.get("origin", [0.0, 0.0]), table.place("origin")),
        )
        true = channel_unit(channel) if body else ""
        entries = {key: entries[i] for key, entries in lines.items()}
        found.line(table, own, channel, (unit or true, true), entries, "outputs")
        found.outputs.append(output)


def _channels(table: Table, name: str) -> tuple[tuple[str, ...], bool]:
    """The channels of a table, and whether it is an instrument of several."""
    if isinstance(table.data.get("channel"), list):
        return table.names("channel") or (), True
    return (table.word("channel") if "channel" in table.data else name,), False


def _shared(table: Table, key: str, default: Any, count: int, several: bool) -> list[Any]:
    """What a key says of each of `count` outputs: one entry for all, or a list."""
    entry = table.data.get(key, default)
    if not (several and isinstance(entry, list)):
        if key == "column" and several and entry is not None:
            raise InputError(table.place(key), f"{entry!r:.60} is not a list", f"name {count} columns")
        return [entry] * count
    if len(entry) != count:
        raise InputError(table.place(key), f"has {len(entry)} entries", f"give {count}, one for each channel")
    return entry


def _sigma(sigma: Any, place: str) -> float | None:
    if sigma == "estimate":
        return None
    if (sigma := read_finite(sigma, place)) <= 0.0:
        raise InputError(place, f"is {sigma:g}", 'give a positive number or "estimate"')
    return sigma


def _unit(table: Table, channel: str, body: bool) -> str:
    """The stated unit of a column, where it is not that of its channel."""
    if "unit" not in table.data:
        return ""
    unit, true = read_unit(table.data["unit"], table.place("unit")), channel_unit(channel) if body else ""
    if not true or not same_dimension(unit, true):
        if true and "scale" not in table.data:
            what = f"is {unit!r}, and {channel} is in {true}"
            raise InputError(table.place("unit"), what, f"add scale = … in {_ratio(unit, true)}")
        return unit
    return ""


def _ratio(recorded: str, true: str) -> str:
    """The unit of what a column in one unit is per channel unit; nothing where the latter may be any."""
    if recorded == true:
        return "1"
    return f"{recorded if recorded.isalpha() else f'({recorded})'}/({true})" if true else ""


def _arm(table: Table) -> tuple[float, float, float]:
    if "lever_arm" not in table.data:
        return STILL
    arm = table.data["lever_arm"]
    if not isinstance(arm, list) or len(arm) != 3:
        raise InputError(table.place("lever_arm"), f"is {arm!r:.60}", "give three numbers in m")
    x, y, z = (read_finite(item, table.place("lever_arm")) for item in arm)
    return x, y, z


def _frame(table: Table, channel: str) -> str:
    """`ENU` or `FLU`; empty for the frames that channels are in otherwise."""
    if "frame" not in table.data:
        return ""
    usual, other = ("NED", "ENU") if channel in FRAMES["ENU"] else ("FRD", "FLU")
    return "" if table.choice("frame", (usual, other)) == usual else other


def _mounting(table: Table, name: str, found: Reading) -> None:
    if "mounting" not in table.data:
        return
    angles, place = table.data["mounting"], table.place("mounting")
    if not isinstance(angles, list) or len(angles) != len(MOUNTING):
        raise InputError(place, f"is {angles!r:.60}", "give the angles of roll, pitch and yaw in rad")
    for key, entry in zip(MOUNTING, angles, strict=True):
        found.number(f"{name}.{key}", entry, place, "rad", "outputs")


def _directions(table: Table) -> list[tuple[float, float, float]]:
    if "directions" not in table.data:
        return []
    entries, place = table.data["directions"], table.place("directions")
    if not isinstance(entries, list) or not entries:
        raise InputError(place, f"is {entries!r:.60}", "give a list of vectors, [x, y, z] each")
    return [Vector(direction=True).read(entry, place) for entry in entries]


def _water(table: Table) -> tuple[float | None, float | None]:
    """Density and latitude by which pressure follows from depth."""
    refuse_two_densities(table)
    density = read_positive(table.data["density"], table.place("density")) if "density" in table.data else None
    latitude = read_latitude(table.data["latitude"], table.place("latitude")) if "latitude" in table.data else None
    return density, latitude


def refuse_two_densities(table: Table) -> None:
    """Refuse a density beside the latitude, by which that of sea water follows."""
    if "density" in table.data and "latitude" in table.data:
        raise InputError(table.place("latitude"), "is given beside density", "delete one; sea water's is by latitude")


def read_origin(entry: Any, place: str) -> tuple[float, float]:
    """Latitude and longitude, rad, where x and y are zero."""
    if not isinstance(entry, list) or len(entry) != 2:
        raise InputError(place, f"is {entry!r:.60}", "give latitude and longitude in rad")
    return read_latitude(entry[0], place), read_finite(entry[1], place)


def read_latitude(entry: Any, place: str) -> float:
    """A latitude between the poles, rad."""
    latitude = read_finite(entry, place)
    if abs(latitude) >= _QUARTER:
        raise InputError(place, f"is {latitude:g}", "give a latitude between the poles, in rad")
    return latitude


def read_columns(
    table: Table, keys: tuple[str, ...], found: Reading
) -> tuple[tuple[tuple[str, str], ...], dict[str, str]]:
    """(name in the model, column) pairs of `[inputs]`, `[prescribed]` or `[environment]`, and SI units that are stated.

    A table `name = { column = "c", … }` may have those of `keys` that are `unit`, `scale` and `offset`; the last two go
    into `found`.
    """
    pairs, units = [], {}
    for name, entry in table.items():
        if isinstance(entry, dict) and keys:
            own = table.table(name)
            own.only(("column", *keys))
            if "unit" in own.data:
                units[name] = read_unit(own.data["unit"], own.place("unit"))
            entry = own.required("column")
            lines = {key: own.data[key] for key in ("scale", "offset") if key in own.data}
            unit = units.get(name) or channel_unit(name) or INPUT_UNITS.get(name, "")
            found.line(own, name, name, (unit, unit), lines, table.section)
        pairs.append((name, read_column(entry, table.place(name), name)))
    return tuple(pairs), units
