"""A torpedo-shaped AUV: a body of revolution with a cruciform tail and a propeller."""

from .columns import Columns, quoted
from .common import SUBMERGED, put_outputs, put_thrust
from .file import InitialFile
from .fins import Fins
from .sizes import Kind, Sizes
from .slender import add_hull, add_water, put_slender

AUV = Kind("an AUV", ("diameter",), ("fin_span", "fin_chord"), speed=1.5)
# span, chord and root of a fin by the diameter, its place by the length: so large that hulls more than five times as
# long as wide keep their course. Those of the REMUS 100 have 0.45 and 0.4, and it does not
_SPAN, _CHORD, _ROOT, _PLACE = 0.5, 0.5, 0.3, -0.45
# by input: names that its column may have, and where a positive deflection pushes
_TAIL = {
    "rudder": (r"delta_?r|rudder\w*|dr", "delta_r", (0.0, 1.0, 0.0)),
    "stern_plane": (r"delta_?[se]|stern\w*|elevator\w*|planes?|d[se]", "delta_s", (0.0, 0.0, -1.0)),
}


def auv(sizes: Sizes, columns: Columns) -> InitialFile:
    """The file of an AUV of those `sizes`, its inputs and outputs those of `columns`."""
    file = InitialFile("AUV")
    put_slender(file, sizes)
    given, diameter = sizes.fin_span > 0.0, sizes.diameter
    span, chord = (sizes.fin_span, sizes.fin_chord) if given else (_SPAN * diameter, _CHORD * diameter)
    fins = Fins(span, chord, _ROOT * diameter, _PLACE * sizes.length, sizes.density, given)
    add_water(file, sizes, fins, fins)
    put_thrust(file, columns, sizes, add_hull(file, sizes, fins, fins))
    for name, (words, usual, direction) in _TAIL.items():
        command = columns.take(words, ["rad"])
        if columns.log is None or command:
            file.put("inputs", name, quoted(command, usual), "rad")
            like = "rudder" if "rudder" in file.tables.get("actuators", {}) else ""
            file.put("actuators", name, fins.actuator(direction, like), "" if like else fins.slope.source)
        else:
            fins.fix(file, vertical=name == "rudder")
    put_outputs(file, columns, SUBMERGED)
    return file
