"""An ROV: a box of frame, floats and thrusters."""

import math

from ...errors import InputError
from ..geometry import added_mass_factors, crossflow_drag
from .columns import Columns
from .common import SUBMERGED, put_body, put_outputs, put_trim
from .file import Estimate, InitialFile
from .sizes import Kind, Sizes
from .thrusters import ARRANGEMENTS, numbered, put_thrusters

ROV = Kind("an ROV", (), ("diameter", "beam", "height"), speed=1.0)
# a cube has 1.05 (Hoerner 1965, §3); frame, thrusters and tether add to it
_DRAG = 1.5
# m/s and rad/s at which linear damping is as large as the quadratic one: forces near rest
_SLOW, _SLOW_TURN = 0.1, 0.3
_USUAL = 8


def rov(sizes: Sizes, columns: Columns) -> InitialFile:
    """The file of an ROV of those `sizes`, its inputs and outputs those of `columns`."""
    beam, height = sizes.beam or sizes.diameter, sizes.height or sizes.diameter
    for name, value in (("--beam", beam), ("--height", height)):
        if not value:
            raise InputError(name, "is missing for an ROV", "give it in m, or --diameter for beam and height")
    box = (sizes.length, beam, height)
    sizes.require_room(sizes.length * beam * height, "a box")
    file = InitialFile("ROV")
    squares = [size**2 for size in box]
    x, y, z = (sizes.mass / 12.0 * (sum(squares) - own) for own in squares)
    put_body(file, sizes, (x, y, z), "of a box", max(beam, height))
    put_trim(file, sizes, height)
    file.put("model", "coriolis", '"full"')
    _add_water(file, sizes, box)
    ahead = _add_drag(file, sizes, box)
    commands = numbered(columns, ARRANGEMENTS)
    count = len(commands) if columns.log else _USUAL
    if count:
        names = [f"t{index}" for index in range(1, count + 1)]
        # four horizontal ones at 45° reach the usual speed
        largest = ahead * sizes.speed**2 / (4.0 * 0.7)
        put_thrusters(file, ARRANGEMENTS[count], names, commands, box, largest)
        file.comments.append("Thrusters are where an ROV with as many usually has them: put in yours.")
    put_outputs(file, columns, SUBMERGED)
    return file


def _add_water(file: InitialFile, sizes: Sizes, box: tuple[float, float, float]) -> None:
    """Added mass of the ellipsoid in the box, and inertia of its rectangular sections, half of it in an open frame."""
    a, b, c = (size / 2.0 for size in box)
    ellipsoid = sizes.density * 4.0 / 3.0 * math.pi * a * b * c
    for name, factor in zip(("X_udot", "Y_vdot", "Z_wdot"), added_mass_factors(a, b, c), strict=True):
        file.add(
            Estimate.within(0.5, -factor * ellipsoid, f"Lamb's k = {factor:.2f} of the ellipsoid in the box"), name
        )
    for name, length, section in (("K_pdot", a, b * c), ("M_qdot", b, a * c), ("N_rdot", c, a * b)):
        turned = 0.5 * 0.234 * math.pi * sizes.density * section**2 * 2.0 * length
        file.add(Estimate.within(1.0, -turned, "half of a square section's (DNV-RP-C205); inertia's error too"), name)


def _add_drag(file: InitialFile, sizes: Sizes, box: tuple[float, float, float]) -> float:
    """Drag of the box's faces, N/(m/s)² ahead, and of their turning."""
    length, beam, height = box
    half = 0.5 * sizes.density * _DRAG
    for name, area in (("X_u", beam * height), ("Y_v", length * height), ("Z_w", length * beam)):
        file.add(Estimate.within(1.0, -_SLOW * half * area, f"as the quadratic at {_SLOW} m/s"), name)
        file.add(Estimate.within(1.0, -half * area, f"faces of the box, C_D = {_DRAG}"), f"{name}|{name[-1]}|")
    turned = {"K_p": (length, beam, height), "M_q": (beam, length, height), "N_r": (height, length, beam)}
    for name, (width, *sides) in turned.items():
        turning = sum(crossflow_drag(sizes.density, side, width, _DRAG)[1] for side in sides)
        file.add(Estimate.within(2.0, -_SLOW_TURN * turning, f"as the quadratic at {_SLOW_TURN} rad/s"), name)
        file.add(Estimate.within(2.0, -turning, "strips of the faces"), f"{name}|{name[-1]}|")
    return half * beam * height
