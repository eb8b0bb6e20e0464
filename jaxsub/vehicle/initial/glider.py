"""A glider: a body of revolution with wings, a buoyancy engine and a mass that is moved to pitch it."""

from .columns import Columns, quoted
from .common import SUBMERGED, put_outputs
from .file import Estimate, InitialFile, number, vector
from .fins import Fins
from .sizes import Kind, Sizes
from .slender import add_hull, add_water, put_slender

GLIDER = Kind("a glider", ("diameter",), ("fin_span", "fin_chord"), speed=0.35)
# of a wing by the length, and of the vertical tail by the diameter, as the Slocum has them
_WING, _TAIL = (0.27, 0.065, -0.1), (0.5, 0.7, -0.5)
# part of the mass that moves, as the Slocum's battery does
_MOVED = 0.2


def glider(sizes: Sizes, columns: Columns) -> InitialFile:
    """The file of a glider of those `sizes`, its inputs and outputs those of `columns`."""
    file = InitialFile("Glider")
    put_slender(file, sizes)
    length, diameter, given = sizes.length, sizes.diameter, sizes.fin_span > 0.0
    span, chord = (sizes.fin_span, sizes.fin_chord) if given else (_WING[0] * length, _WING[1] * length)
    wings = Fins(span, chord, diameter / 2.0, _WING[2] * length, sizes.density, given)
    tail = Fins(_TAIL[0] * diameter, _TAIL[1] * diameter, 0.3 * diameter, _TAIL[2] * length, sizes.density, False)
    add_water(file, sizes, tail, wings)
    add_hull(file, sizes, tail, wings)
    wings.fix(file, vertical=False)
    forward = Estimate.within(0.5, wings.lift * (1.0 - wings.induced), "lift of the wings, tilted, less induced drag")
    file.add(forward, "X_ww")
    _put_engine(file, columns, sizes)
    rudder = columns.take(r"delta_?r|rudder\w*|fin|dr", ["rad"])
    if columns.log is None or rudder:
        file.put("inputs", "rudder", quoted(rudder, "delta_r"), "rad")
        file.put("actuators", "rudder", tail.actuator((0.0, 1.0, 0.0)), tail.slope.source)
    else:
        tail.fix(file, vertical=True)
    put_outputs(file, columns, SUBMERGED)
    return file


def _put_engine(file: InitialFile, columns: Columns, sizes: Sizes) -> None:
    """The buoyancy engine in the nose, and the mass that moves ahead by a positive command."""
    nose = vector(0.3 * sizes.length, 0.0, 0.0)
    engine = columns.take(r"(?:\w*_)?(?:oil|ballast|vbd|engine|bladder|pump|buoyancy|piston)(?:_\w*)?", ["m^3", "kg"])
    if columns.log is None or engine:
        unit = "kg" if engine and engine.unit == "kg" else "m^3"
        file.put("inputs", "engine", f'{{ column = {quoted(engine, "engine")}, unit = "{unit}" }}')
        of = f'of = "{"mass" if unit == "kg" else "volume"}", gain = {Estimate(1.0, 0.05).toml(free=True)}'
        file.put(
            "actuators", "engine", f'{{ kind = "ballast", position = {nose}, {of} }}', "in the nose, as the Slocum's"
        )
    moved = columns.take(r"(?:\w*_)?(?:batt?pos|battery|pitch_mass|moving_mass|mass|shifter)(?:_\w*)?", ["m"])
    if columns.log is None or moved:
        file.put("inputs", "pitch_mass", f'{{ column = {quoted(moved, "pitch_mass")}, unit = "m" }}')
        mass = Estimate.within(0.5, _MOVED * sizes.mass).toml(free=True)
        table = f'{{ kind = "moving-mass", direction = [1.0, 0.0, 0.0], mass = {mass} }}'
        file.put("actuators", "pitch_mass", table, f"{number(_MOVED)} of the mass, as the Slocum's battery")
