"""Hulls of revolution: what AUVs and gliders share."""

import math

from ..geometry import (
    added_inertia_factors,
    added_mass_factors,
    crossflow_drag,
    form_factor,
    friction_drag,
    hull_lift,
)
from .common import put_body, put_speed, put_trim
from .file import Estimate, InitialFile
from .fins import Fins
from .sizes import Sizes

# of a cylinder and of a flat plate across the flow: Hoerner (1965), §3
_CYLINDER, _PLATE = 1.1, 1.2


def put_slender(file: InitialFile, sizes: Sizes) -> None:
    """`[body]` and `[model]` of a hull of revolution that is trimmed."""
    sizes.require_room(math.pi / 4.0 * sizes.diameter**2 * sizes.length, "a cylinder")
    turned, rolled = sizes.mass * (0.25 * sizes.length) ** 2, sizes.mass * (0.35 * sizes.diameter) ** 2
    put_body(file, sizes, (rolled, turned, turned), "radii of gyration 0.35 d and 0.25 L", sizes.diameter)
    put_speed(file, sizes)
    put_trim(file, sizes, sizes.diameter)
    file.put("model", "coriolis", '"full"')


def add_water(file: InitialFile, sizes: Sizes, vertical: Fins, horizontal: Fins) -> None:
    """Added mass of the ellipsoid of these axes, in proportion to the water that the vehicle displaces, and of fins.

    `vertical` fins move water in sway and yaw, `horizontal` ones in heave and pitch.
    """
    axes = (sizes.length / 2.0, sizes.diameter / 2.0, sizes.diameter / 2.0)
    (k1, k2, _), k3 = added_mass_factors(*axes), added_inertia_factors(*axes)[1]
    mass, bare = sizes.mass, k3 * sizes.mass * sizes.length**2 / 16.0
    file.add(Estimate.within(0.5, -k1 * mass, f"Lamb's k1 = {k1:.3f} of the displaced mass"), "X_udot")
    source = f"Lamb's k2 = {k2:.3f}, and fins as flat plates"
    file.add(Estimate.within(0.2, -k2 * mass - vertical.water, source), "Y_vdot")
    file.add(Estimate.within(0.2, -k2 * mass - horizontal.water, "as Y_vdot"), "Z_wdot")
    file.add(Estimate.within(1.0, -vertical.rolling - horizontal.rolling, "of the fins (Blevins 1979)"), "K_pdot")
    source = f"Lamb's k' = {k3:.3f}, and fins; inertia's error too"
    file.add(Estimate.within(0.3, -bare - horizontal.water * horizontal.place**2, source), "M_qdot")
    file.add(Estimate.within(0.3, -bare - vertical.water * vertical.place**2, "as M_qdot"), "N_rdot")
    file.add(Estimate.within(1.0, -vertical.water * vertical.place, "of the fins, by their lever"), "Y_rdot")
    file.add(Estimate.within(1.0, horizontal.water * horizontal.place, "as Y_rdot"), "Z_qdot")


def add_hull(file: InitialFile, sizes: Sizes, vertical: Fins, horizontal: Fins) -> Estimate:
    """Friction, lift and cross-flow of the hull, and plates across the flow; the drag ahead is the answer."""
    length, diameter, density = sizes.length, sizes.diameter, sizes.density
    wetted, form = 0.85 * math.pi * diameter * length, form_factor(length, diameter)
    drag = Estimate.within(0.6, 1.5 * friction_drag(density, wetted, sizes.speed, length, form))
    source = "ITTC-57 and form factor (Hoerner 1965), half more for fins"
    file.add(Estimate(-drag.value, drag.std, source), "X_u|u|")
    lift, centre = hull_lift(density, length, diameter)
    file.add(Estimate.within(0.5, -lift, "lift of the hull (Hoerner 1965, §19)"), "Y_uv", "Z_uw")
    file.add(Estimate.within(1.0, -lift * centre, "the same, 0.65 L from the nose; Munk's moment is Coriolis"), "N_uv")
    file.add(Estimate.within(1.0, lift * centre, "as N_uv"), "M_uw")
    across, turning = crossflow_drag(density, length, diameter, _CYLINDER)
    source = f"strips of a cylinder, C_D = {_CYLINDER}, and fins, {_PLATE}"
    for fins, force, moment in ((vertical, "Y_v|v|", "N_r|r|"), (horizontal, "Z_w|w|", "M_q|q|")):
        plates = 0.5 * density * _PLATE * fins.area
        file.add(Estimate.within(0.4, -across - plates, source), force)
        file.add(Estimate.within(0.6, -turning - plates * abs(fins.place) ** 3, f"as {force}, in turning"), moment)
    damping = vertical.roll_damping + horizontal.roll_damping
    file.add(Estimate.within(0.7, -damping, "lift of the fins by roll"), "K_up")
    return drag
