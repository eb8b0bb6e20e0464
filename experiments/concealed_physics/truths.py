"""Everything that can be concealed, by key."""

from .actuators import ACTUATORS
from .hull import HULL
from .hydrostatics import HYDROSTATICS
from .outside import OUTSIDE
from .sensors import MECHANISMS, SENSORS
from .surroundings import SURROUNDINGS
from .truth import Truth

KNOWN: tuple[Truth, ...] = (*HULL, *HYDROSTATICS, *ACTUATORS, *SURROUNDINGS, *SENSORS, *MECHANISMS)


def identifier(truth: Truth) -> str:
    """What a plan calls it: vehicle, name and form."""
    return f"{truth.vehicle}/{truth.key}"


TRUTHS: dict[str, Truth] = {identifier(truth): truth for truth in (*KNOWN, *OUTSIDE)}


def by_name() -> dict[str, list[Truth]]:
    """The forms of each effect of the vocabulary."""
    forms: dict[str, list[Truth]] = {}
    for truth in KNOWN:
        forms.setdefault(truth.name, []).append(truth)
    return forms
