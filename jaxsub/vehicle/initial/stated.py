"""The geometry that a vehicle file states, and the file that is begun from it."""

from collections.abc import Mapping

from ...errors import InputError
from ..layout import Geometry
from ..schema import Table, read_positive
from .file import InitialFile
from .kinds import KINDS, initial_file
from .sizes import SIZES


def read_geometry(table: Table, body: Mapping[str, float]) -> Geometry | None:
    """The kind and the sizes in `geometry = { kind = "auv", length = …, … }`; None where a file has no such table.

    Those of `body` (SI) count where the table does not say: `mass`, `length`, `diameter`, `speed` and `density`.
    **Raises** `InputError` as `initial_file` does, for the keys of the file.
    """
    if not table.data:
        return None
    kind = table.choice("kind", tuple(KINDS))
    of, _ = KINDS[kind]
    known = ("length", "mass", *of.needs, *of.takes, "speed", "density")
    table.only(("kind", *known))
    own = {key: read_positive(table.data[key], table.place(key)) for key in known if key in table.data}
    sizes = {key: body[key] for key in known if body.get(key, 0.0) > 0.0} | own
    geometry = kind, tuple((key, sizes[key]) for key in SIZES if key in sizes)
    try:
        begun(geometry)
    except InputError as error:
        option, what, remedy = error.parts
        raise InputError(table.place(option.removeprefix("--").replace("-", "_")), what, remedy) from error
    return geometry


def begun(geometry: Geometry) -> InitialFile:
    """The file that is begun from a stated geometry."""
    kind, sizes = geometry
    return initial_file(kind, dict(sizes))
