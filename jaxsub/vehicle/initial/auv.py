"""A torpedo-shaped AUV: a body of revolution with a cruciform tail and a propeller."""

import math

from ..geometry import (
    added_inertia_factors,
    added_mass_factors,
    crossflow_drag,
    form_factor,
    friction_drag,
    hull_lift,
)
from .columns import Columns
from .common import SUBMERGED, put_body, put_outputs, put_thrust
from .file import Estimate, InitialFile
from .fins import Fins
from .sizes import Kind, Sizes

AUV = Kind("an AUV", ("diameter",), ("fin_span", "fin_chord"), speed=1.5)
# span, chord and root of a fin by the diameter, its place by the length: so large that hulls seven times as long as
# wide keep their course, and a fifth larger than the REMUS 100's
_SPAN, _CHORD, _ROOT, _PLACE = 0.55, 0.5, 0.3, -0.45
# of a cylinder and of a flat plate across the flow: Hoerner (1965), §3
_CYLINDER, _PLATE = 1.1, 1.2


def auv(sizes: Sizes, columns: Columns) -> InitialFile:
    """The file of an AUV of those `sizes`, its inputs and outputs those of `columns`."""
    length, diameter = sizes.length, sizes.diameter
    sizes.require_room(math.pi / 4.0 * diameter**2 * length, "a cylinder")
    file = InitialFile("AUV")
    turned = 0.25**2 * sizes.mass * length**2
    rolled = 0.35**2 * sizes.mass * diameter**2
    put_body(file, sizes, (rolled, turned, turned), "radii of gyration 0.35 d and 0.25 L", diameter)
    file.put("body", "diameter", diameter)
    file.put("model", "coriolis", '"full"')
    given = sizes.fin_span > 0.0
    span, chord = (sizes.fin_span, sizes.fin_chord) if given else (_SPAN * diameter, _CHORD * diameter)
    fins = Fins(span, chord, _ROOT * diameter, _PLACE * length, sizes.density, given)
    _add_water(file, sizes, fins)
    drag = _add_hull(file, sizes, fins)
    put_thrust(file, columns, sizes, drag)
    for name, words, direction in (
        ("rudder", r"delta_?r|rudder\w*|dr", (0.0, 1.0, 0.0)),
        ("stern_plane", r"delta_?[se]|stern\w*|elevator\w*|plane|d[se]", (0.0, 0.0, -1.0)),
    ):
        column = {"rudder": "delta_r", "stern_plane": "delta_s"}[name]
        command = columns.take(words, ["rad"])
        if columns.log is None or command:
            file.put("inputs", name, f'"{command.column if command else column}"', "rad")
            like = next(iter(file.tables.get("actuators", {}).keys() & {"rudder"}), "")
            file.put("actuators", name, fins.actuator(direction, like), "" if like else fins.slope.source)
        else:
            fins.fix(file, upright=name == "rudder")
    put_outputs(file, columns, SUBMERGED)
    return file


def _add_water(file: InitialFile, sizes: Sizes, fins: Fins) -> None:
    """Added mass of the ellipsoid of these axes, in proportion to the water that the vehicle displaces, and of fins."""
    axes = (sizes.length / 2.0, sizes.diameter / 2.0, sizes.diameter / 2.0)
    (k1, k2, _), k3 = added_mass_factors(*axes), added_inertia_factors(*axes)[1]
    mass, arm = sizes.mass, fins.water * fins.place
    file.add(Estimate.within(0.5, -k1 * mass, f"Lamb's k1 = {k1:.3f} of the displaced mass"), "X_udot")
    source = f"Lamb's k2 = {k2:.3f}, and fins as flat plates"
    file.add(Estimate.within(0.2, -k2 * mass - fins.water, source), "Y_vdot", "Z_wdot")
    file.add(Estimate.within(1.0, -2.0 * fins.rolling, "of the fins as a cross (Blevins 1979)"), "K_pdot")
    source = f"Lamb's k' = {k3:.3f}, and fins; error of the inertia too"
    turned = k3 * mass * sizes.length**2 / 16.0 + arm * fins.place
    file.add(Estimate.within(0.3, -turned, source), "M_qdot", "N_rdot")
    file.add(Estimate.within(1.0, -arm, "of the fins, by their lever"), "Y_rdot")
    file.add(Estimate.within(1.0, arm, "as Y_rdot"), "Z_qdot")


def _add_hull(file: InitialFile, sizes: Sizes, fins: Fins) -> Estimate:
    """Friction, lift and cross-flow of the hull; its drag ahead is the answer."""
    length, diameter, density = sizes.length, sizes.diameter, sizes.density
    wetted, form = 0.85 * math.pi * diameter * length, form_factor(length, diameter)
    ahead = 1.5 * friction_drag(density, wetted, sizes.speed, length, form)
    drag = Estimate.within(0.6, ahead)
    source = "ITTC-57 and form factor (Hoerner 1965), half more for fins"
    file.add(Estimate(-drag.value, drag.std, source), "X_u|u|")
    lift, centre = hull_lift(density, length, diameter)
    file.add(Estimate.within(0.5, -lift, "lift of the hull (Hoerner 1965, §19)"), "Y_uv", "Z_uw")
    file.add(Estimate.within(1.0, -lift * centre, "the same, 0.65 L from the nose; Munk's moment is Coriolis"), "N_uv")
    file.add(Estimate.within(1.0, lift * centre, "as N_uv"), "M_uw")
    sway, yaw = crossflow_drag(density, length, diameter, _CYLINDER)
    plates = 0.5 * density * _PLATE * fins.area
    source = f"strips of a cylinder, C_D = {_CYLINDER}, and fins, {_PLATE}"
    file.add(Estimate.within(0.4, -sway - plates, source), "Y_v|v|", "Z_w|w|")
    file.add(Estimate.within(0.6, -yaw - plates * abs(fins.place) ** 3, source), "M_q|q|", "N_r|r|")
    file.add(Estimate.within(0.7, -2.0 * fins.roll_damping, "lift of the four fins by roll"), "K_up")
    return drag
