"""The kinds of vehicles that a file can be begun for."""

from collections.abc import Callable, Mapping

from ...recording import Recording
from .auv import AUV, auv
from .columns import Columns
from .file import InitialFile, number
from .floating import SHIP, USV, ship, usv
from .glider import GLIDER, glider
from .rov import ROV, rov
from .sizes import SIZES, Kind, Sizes

KINDS: dict[str, tuple[Kind, Callable[[Sizes, Columns], InitialFile]]] = {
    "auv": (AUV, auv),
    "glider": (GLIDER, glider),
    "rov": (ROV, rov),
    "ship": (SHIP, ship),
    "usv": (USV, usv),
}


def initial_file(kind: str, given: Mapping[str, float], log: Recording | None = None) -> InitialFile:
    """The file of a vehicle of that `kind`, one of `KINDS`.

    `given` are its dimensions by the names of `SIZES`, SI. Inputs and outputs are those columns of the `log` that the
    kind has; without one, usual ones.

    **Raises** `InputError` for dimensions that are missing, not positive, not the kind's or contradict each other, and
    for a log without a channel that the vehicle produces.
    """
    of, begin = KINDS[kind]
    file = begin(Sizes.of(of, given), Columns(log))
    said = ", ".join(f"{name.replace('_', ' ')} {value:g} {SIZES[name]}" for name, value in given.items())
    stated = ", ".join([f'kind = "{kind}"', *(f"{name} = {number(value, 12)}" for name, value in given.items())])
    file.geometry = f"{{ {stated} }}"
    file.comments = [
        f"Begun by `jaxsub init {kind}`: {said}.",
        "Every number is an estimate from these, with its standard deviation. The origin is the centre of gravity.",
        *file.comments,
    ]
    return file
