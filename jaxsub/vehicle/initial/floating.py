"""Ships, and catamarans that two thrusters steer: in surge, sway and yaw, with the derivatives of slender hulls."""

import dataclasses
import math

from ...effects import GRAVITY
from ..geometry import added_inertia_factors, added_mass_factors, crossflow_drag, friction_drag
from .columns import SHAFT, Columns, quoted
from .common import SURFACE, put_body, put_outputs, put_speed
from .file import Estimate, InitialFile, number, vector
from .sizes import Kind, Sizes
from .thrusters import numbered, put_thrusters, twin

SHIP = Kind("a ship", ("beam", "draught"), speed=0.0)
USV = Kind("a catamaran", ("beam", "draught"), speed=1.5)
# usual speeds of ships are about this part of the square root of g L
_FROUDE = 0.15
_CROSS = 0.8  # cross-flow drag of a ship's sections (Hoerner 1965; Faltinsen 1990, §6)


@dataclasses.dataclass(frozen=True)
class Hull:
    """One of `count` equal hulls.

    **Fields**: `length`, `beam`, `draught` m; `block`: coefficient.
    """

    length: float
    beam: float
    draught: float
    block: float
    count: int = 1


def ship(sizes: Sizes, columns: Columns) -> InitialFile:
    """The file of a ship with a propeller and a rudder."""
    sizes.require_room(sizes.length * sizes.beam * sizes.draught, "a box")
    if not sizes.speed:
        sizes = dataclasses.replace(sizes, speed=_FROUDE * math.sqrt(GRAVITY * sizes.length))
    block = sizes.displaced / (sizes.length * sizes.beam * sizes.draught)
    hull = Hull(sizes.length, sizes.beam, sizes.draught, block)
    file = _begun("Ship", sizes, hull, residual=1.3)
    shaft = columns.take(SHAFT, ["rad/s"], stated=True)
    wake = 0.5 * block - 0.05
    if columns.log is None or shaft:
        file.put("inputs", "shaft_speed", quoted(shaft, "n"), "rad/s")
        keys = f"position = {vector(-0.48 * sizes.length, 0.0, 0.0)}, diameter = {number(0.6 * sizes.draught)}"
        keys += f", K_T = [0.3, -0.28, -0.13], wake = {number(wake)}, thrust_deduction = {number(0.6 * wake)}"
        keys += f", gain = {Estimate(1.0, 0.3).toml(free=True)}"
        table = f'{{ kind = "propeller", input = "shaft_speed", {keys} }}'
        file.put("actuators", "propeller", table, "typical: four blades, wake of Taylor; put in yours")
    else:
        thrust = -file.coefficients["X_u|u|"].value * sizes.speed**2
        file.add(Estimate.within(0.5, thrust, "thrust that keeps the usual speed: the log has none"), "X_0")
    command = columns.take(r"delta|delta_?r|rudder\w*|dr", ["rad"])
    if columns.log is None or command:
        file.put("inputs", "rudder", quoted(command, "delta"), "rad, positive to starboard")
        area = sizes.length * sizes.draught / 100.0 * (1.0 + 50.0 * (block * sizes.beam / sizes.length) ** 2)
        keys = f"position = {vector(-0.5 * sizes.length, 0.0, 0.0)}, area = {number(area)}"
        keys += f", lift_slope = {Estimate(2.5, 0.8).toml(free=True)}, t_R = 0.35, a_H = 0.3"
        keys += f", x_H = {number(-0.45 * sizes.length)}, l_R = {number(-0.7 * sizes.length)}, gamma_R = [0.4, 0.6]"
        race = 'propeller = "propeller", ' if "shaft_speed" in file.tables["inputs"] else ""
        table = f'{{ kind = "rudder", {race}{keys} }}'
        file.put("actuators", "rudder", table, "area by DNV's rule, the rest typical of the MMG method")
    put_outputs(file, columns, SURFACE)
    return file


def usv(sizes: Sizes, columns: Columns) -> InitialFile:
    """The file of a catamaran whose two hulls each have a thruster."""
    sizes.require_room(sizes.length * sizes.beam * sizes.draught, "a box")
    block = 0.6
    beam = min(sizes.displaced / (2.0 * block * sizes.length * sizes.draught), 0.5 * sizes.beam)
    hull = Hull(sizes.length, beam, sizes.draught, block, count=2)
    # waves at the Froude numbers at which such craft run
    file = _begun("USV", sizes, hull, residual=3.0)
    sides = (
        columns.take("(?:.*_)?(?:left|port)(?:_.*)?", []),
        columns.take("(?:.*_)?(?:right|starboard|stbd)(?:_.*)?", []),
    )
    commands = [side for side in sides if side is not None]
    if len(commands) < 2:
        columns.put_back(commands)
        commands = numbered(columns, (2,))
    if columns.log is None or len(commands) == 2:
        drag = -file.coefficients["X_u|u|"].value * sizes.speed**2
        box = (sizes.length, sizes.beam, sizes.draught)
        put_thrusters(file, twin(), ("port", "starboard"), commands, box, drag / 2.0)
    put_outputs(file, columns, SURFACE)
    return file


def _begun(name: str, sizes: Sizes, hull: Hull, residual: float) -> InitialFile:
    """Body and hull, whose drag ahead is `residual` times its friction."""
    file = InitialFile(name, ("surge", "sway", "yaw"))
    file.comments.append("N_Uv holds the Munk moment, and X_vr the other Coriolis force of added mass (MMG method).")
    apart = (sizes.beam - hull.beam) / 2.0 if hull.count == 2 else 0.0
    turned = sizes.mass * ((0.25 * sizes.length) ** 2 + apart**2)
    rolled = sizes.mass * (0.35 * sizes.beam) ** 2
    source = f"radii of gyration 0.35 B and 0.25 L{', and of the hulls apart' if apart else ''}"
    put_body(file, sizes, (rolled, turned, turned), source, sizes.beam)
    put_speed(file, sizes)
    file.put("model", "coriolis", '"rigid-body"')
    axes = (hull.length / 2.0, hull.beam / 2.0, hull.draught)
    (k1, k2, _), k3 = added_mass_factors(*axes), added_inertia_factors(*axes)[2]
    file.add(Estimate.within(0.8, -k1 * sizes.mass, f"Lamb's k1 = {k1:.3f} of a double body"), "X_udot")
    file.add(Estimate.within(0.4, -k2 * sizes.mass, f"Lamb's k2 = {k2:.3f}"), "Y_vdot")
    around = k3 * sizes.mass * sizes.length**2 / 16.0 + k1 * sizes.mass * apart**2
    file.add(Estimate.within(0.4, -around, f"Lamb's k' = {k3:.3f}; error of the inertia too"), "N_rdot")
    file.add(Estimate.within(0.5, k2 * sizes.mass, "added mass in sway, by turning"), "X_vr")
    wetted = hull.count * (1.7 * hull.length * hull.draught + sizes.displaced / hull.count / hull.draught)
    drag = residual * friction_drag(sizes.density, wetted, sizes.speed, sizes.length)
    file.add(Estimate.within(0.5, -drag, f"{residual:g} times the friction of ITTC-57"), "X_u|u|")
    _add_clarke(file, sizes.density, hull)
    sway, yaw = crossflow_drag(sizes.density, hull.length, hull.draught, _CROSS)
    file.add(Estimate.within(0.5, -sway, f"strips, C_D = {_CROSS}"), "Y_v|v|")
    file.add(Estimate.within(0.7, -yaw, "as Y_v|v|, in turning"), "N_r|r|")
    return file


def _add_clarke(file: InitialFile, density: float, hull: Hull) -> None:
    """Linear derivatives by the regression of Clarke, Gedling and Hine (1983), by the speed."""
    length, slender = hull.length, hull.draught / hull.length
    fullness, wide = hull.block * hull.beam / hull.draught, hull.beam / hull.draught
    unit = hull.count * math.pi * slender**2 * 0.5 * density * length**2
    broad = hull.beam / length
    source = "Clarke, Gedling and Hine (1983)"
    for name, value, part in (
        ("Y_Uv", 1.0 + 0.4 * fullness, 0.3),
        ("Y_Ur", (-0.5 + 2.2 * broad - 0.08 * wide) * length, 0.5),
        ("N_Uv", (0.5 + 2.4 * slender) * length, 0.3),
        # broader than the ships of the regression, a hull is damped all the same
        ("N_Ur", max(0.25 + 0.039 * wide - 0.56 * broad, 0.1) * length**2, 0.4),
    ):
        file.add(Estimate.within(part, -unit * value, source), name)
