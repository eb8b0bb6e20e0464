"""Which keys an output of a vehicle file may have, by its channel."""

from ...errors import InputError
from ..schema import Table, unknown_key
from .output import FRAMES, GEODETIC, POSITION, SPECIFIC_FORCE, TRIADS, TURNING, VELOCITY

EVERY = ("channel", "column", "unit", "sigma", "scale", "offset")
_ARMED = (*VELOCITY, *SPECIFIC_FORCE, *POSITION, "pressure", *GEODETIC, "beam")
# a key, the channels that have it, and what to do for others
_OF_BODY: dict[str, tuple[tuple[str, ...], str]] = {
    "lever_arm": (_ARMED, "delete it; angles and turning rates are the same everywhere in a body"),
    "mounting": ((*VELOCITY, *TURNING, *SPECIFIC_FORCE, "beam"), "delete it; of an angle, give the offset"),
    "frame": ((*FRAMES["ENU"], *FRAMES["FLU"]), "give the scale -1 where the sign is another"),
    "wrap": (("psi",), "delete it; it says how a heading is written"),
    "density": (("pressure",), "delete it; by it pressure follows from depth"),
    "latitude": (("pressure",), "delete it; by it pressure follows from depth"),
    "origin": (GEODETIC, "delete it; x and y begin at zero"),
    "directions": (("beam",), "delete it; beams have directions"),
}
KEYS = (*EVERY, *_OF_BODY)
_REQUIRED = {"origin": GEODETIC, "directions": ("beam",)}


def check_keys(table: Table, channels: tuple[str, ...], body: bool) -> None:
    """Refuse keys that none has, that its channels do not use, and the lack of those that they need."""
    table.only(KEYS if body else (*EVERY, *(key for key in _OF_BODY if key in table.data)))
    for channel in channels:
        for key, (used, remedy) in _OF_BODY.items():
            if key in table.data and (not body or channel not in used):
                raise InputError(table.place(key), f"{channel} does not use it", remedy if body else "delete it")
        for key, needed in _REQUIRED.items():
            if body and channel in needed:
                table.required(key)


def check_channels(table: Table, channels: tuple[str, ...], known: tuple[str, ...]) -> None:
    """Refuse channels that the vehicle does not produce, and those that no one instrument has."""
    for channel in channels:
        if channel not in known:
            place = table.place("channel") if "channel" in table.data else f"{table.where}: {table.section}"
            raise unknown_key(place, known, channel)
    if len(channels) > 1 and not any(set(channels) <= set(sort) for sort in (*TRIADS, ("x", "y", "z"), GEODETIC)):
        remedy = "name some of one kind, such as u, v and w, and give others a table of their own"
        raise InputError(table.place("channel"), f"no instrument has {' and '.join(channels)}", remedy)
