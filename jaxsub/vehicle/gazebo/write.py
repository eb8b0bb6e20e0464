"""Gazebo models out: a vehicle to SDF."""

import math
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence

import numpy as np

from ...effects import EQUATIONS, GRAVITY
from ...effects.hull import coriolis
from ..actuators.thruster import Thruster
from ..inertia import CENTRE_OF_GRAVITY, RIGID, twin
from ..submerged_body import SubmergedBody
from .sdf import steiner
from .terms import FLIP, FORCES, RATES, tag

_PROPELLER, _DENSITY = 0.1, 1000.0  # diameter in m and kg/m³ by which a thruster's curve is stated
_PART = 1e-3  # of the vehicle's mass that is a thruster's link; the hull has as much less
_WITHOUT_LIMIT = 1e9


def sdf_text(vehicle: SubmergedBody) -> tuple[str, list[str]]:
    r"""The model of a vehicle for Gazebo Harmonic as SDF, and what of the vehicle it lacks, by name.

    The plugin's own Coriolis forces, which have other signs than Fossen's, are switched off: what the vehicle has of
    them is among the quadratic terms. A sphere displaces so much water that buoyancy is to weight as in the vehicle.
    Thrusters are links on revolute joints; one with a quadratic curve takes a shaft speed in rad/s.
    """
    values = {name: float(value) for name, value in vehicle.own_values().items()}
    terms, lost = _terms(vehicle, values)
    lost += _not_translated(vehicle, values)
    root = ET.Element("sdf", version="1.10")
    said = [f"Not translated: {one}." for one in lost] or ["All of the vehicle is translated."]
    root.append(ET.Comment("\n".join(["", *(line.replace("--", "- -") for line in said), ""])))
    model = ET.SubElement(root, "model", name=vehicle.layout.name)
    thrusters = _thrusters(vehicle)
    _add_hull(model, vehicle, values, thrusters)
    for item in thrusters:
        _add_link(model, item, _PART * values["mass"])
    hydrodynamics = _add_system(model, "hydrodynamics", "Hydrodynamics")
    for key, text in {"link_name": "base_link", "disable_coriolis": "true", **terms}.items():
        ET.SubElement(hydrodynamics, key).text = text if isinstance(text, str) else repr(text)
    for item in thrusters:
        _add_thruster(model, item)
    ET.indent(root)
    return f'<?xml version="1.0"?>\n{ET.tostring(root, encoding="unicode")}\n', lost


def _terms(vehicle: SubmergedBody, values: Mapping[str, float]) -> tuple[dict[str, float], list[str]]:
    """The plugin's elements with their values, and the derivatives that it has none for."""
    added = {name: values[name] for name in vehicle.inertia.added}
    added = {twin(name): value for name, value in added.items()} | added
    own = added | {name: values[name] for part in (vehicle.damping, vehicle.products) for name in part.coefficients}
    terms: dict[str, float] = {}
    lost = []
    parts = [*own.items(), *(_carried(vehicle) if vehicle.coriolis == "full" else [])]
    for name, value in parts:
        if (found := tag(name)) is None:
            lost.append(f"coefficients.{name}")
        elif value:
            key, sign = found
            terms[key] = terms.get(key, 0.0) + sign * value
    return terms, lost


def _carried(vehicle: SubmergedBody) -> list[tuple[str, float]]:
    r"""$-C_A(\nu)\nu$ as derivatives by products of two velocities."""
    matrix = np.asarray(vehicle.inertia.matrix() - vehicle.inertia.body_matrix(), float)
    force = lambda velocity: np.asarray(coriolis(matrix, velocity), float)
    unit, found = np.eye(6), []
    for j in range(6):
        for k in range(j, 6):
            part = force(unit[j]) if j == k else force(unit[j] + unit[k]) - force(unit[j]) - force(unit[k])
            found += [(f"{FORCES[i]}_{RATES[j]}{RATES[k]}", float(part[i])) for i in np.flatnonzero(part)]
    return found


def _add_hull(
    model: ET.Element, vehicle: SubmergedBody, values: Mapping[str, float], thrusters: Sequence[Thruster]
) -> None:
    """The link of the hull: the vehicle's mass and inertia less its thrusters', and a sphere of its volume."""
    mass, part = values["mass"], _PART * values["mass"]
    centre = FLIP @ np.array([values.get(name, 0.0) for name in CENTRE_OF_GRAVITY])
    about = np.diag([values[name] for name in RIGID[3:]])
    places = [FLIP @ np.array(item.position) for item in thrusters]
    hull = mass - part * len(places)
    own = (mass * centre - part * sum(places, np.zeros(3))) / hull
    inertia = about - hull * steiner(own) - sum((_ball(part) + part * steiner(at) for at in places), np.zeros((3, 3)))
    link = ET.SubElement(model, "link", name="base_link")
    _add_inertial(link, hull, own, inertia)
    volume = values["buoyancy"] / values["weight"] * mass / vehicle.restoring.reference_density
    collision = ET.SubElement(link, "collision", name="buoyancy")
    buoyant = FLIP @ np.array([values[name] for name in ("x_B", "y_B", "z_B")])
    ET.SubElement(collision, "pose").text = _text(buoyant, np.zeros(3))
    sphere = ET.SubElement(ET.SubElement(collision, "geometry"), "sphere")
    ET.SubElement(sphere, "radius").text = repr(math.cbrt(volume * 3.0 / (4.0 * math.pi)))


def _add_link(model: ET.Element, item: Thruster, mass: float) -> None:
    """A thruster's link and its joint, whose axis is the direction of the thrust."""
    link = ET.SubElement(model, "link", name=item.name)
    ET.SubElement(link, "pose").text = _text(FLIP @ np.array(item.position), np.zeros(3))
    _add_inertial(link, mass, np.zeros(3), _ball(mass))
    joint = ET.SubElement(model, "joint", name=f"{item.name}_joint", type="revolute")
    ET.SubElement(joint, "parent").text = "base_link"
    ET.SubElement(joint, "child").text = item.name
    ET.SubElement(ET.SubElement(joint, "axis"), "xyz").text = _text(FLIP @ np.array(item.direction))


def _add_thruster(model: ET.Element, item: Thruster) -> None:
    plugin = _add_system(model, "thruster", "Thruster")
    low, high = (math.copysign(min(abs(limit), _WITHOUT_LIMIT), limit) for limit in item.limits)
    said = {"joint_name": f"{item.name}_joint", "min_thrust_cmd": repr(low), "max_thrust_cmd": repr(high)}
    said |= {"fluid_density": repr(_DENSITY), "propeller_diameter": repr(_PROPELLER)}
    if "forward" in item.numbers:
        curve = float(item.numbers["forward"] * item.value("gain", 1.0)) / (_DENSITY * _PROPELLER**4)
        said |= {"use_angvel_cmd": "true", "thrust_coefficient": repr(curve)}
    else:
        said["thrust_coefficient"] = "0.01"  # of the speed at which the propeller is drawn alone
    for key, text in said.items():
        ET.SubElement(plugin, key).text = text


def _not_translated(vehicle: SubmergedBody, values: Mapping[str, float]) -> list[str]:
    """What of a vehicle besides derivatives a model of Gazebo does not have, by name."""
    layout, lost = vehicle.layout, []
    if vehicle.coriolis == "linear":
        lost.append('model.coriolis = "linear": Gazebo has the full rigid-body forces')
    if locked := [e for e in EQUATIONS if e not in layout.equations]:
        lost.append(f"dof: {', '.join(locked)} move in Gazebo")
    if abs(values["weight"] / (GRAVITY * values["mass"]) - 1.0) > 1e-3:
        lost.append("body.weight: in Gazebo it is mass times the world's gravity")
    for section in ("prescribed", "environment"):
        lost += [f"{section}.{name}" for name, _ in getattr(layout, section)]
    thrusters = _thrusters(vehicle)
    for item in vehicle.actuators.items:
        named = f"actuators.{item.name}"
        found = next((one for one in thrusters if one is item), None)
        lost += [f"{named} ({item.kind})"] if found is None else [f"{named}.{key}" for key in _keys(found)]
    commanded = {name for item in vehicle.actuators.items for name, _ in item.input}
    lost += [f"inputs.{name}" for name, _ in layout.inputs if name not in commanded]
    return lost + [f"effects ({effect.label})" for effect in vehicle.effects]


def _keys(item: Thruster) -> list[str]:
    """Keys of a thruster that Gazebo's does not have."""
    curved = "forward" in item.numbers
    known = {"forward"}
    if curved or float(item.value("gain", 1.0)) == 1.0:
        known.add("gain")
    if curved and float(item.value("reverse")) == float(item.value("forward")):
        known.add("reverse")
    others = [name for name in item.numbers if name not in known and not name.startswith("thrust_")]
    return [*others, *(["thrust"] if item.shaped else [])]


def _thrusters(vehicle: SubmergedBody) -> list[Thruster]:
    """The thrusters that follow one input."""
    items = vehicle.actuators.items
    return [item for item in items if isinstance(item, Thruster) and [weight for _, weight in item.input] == [1.0]]


def _ball(mass: float) -> np.ndarray:
    """Inertia (3, 3) of a ball of the propeller's diameter about its middle."""
    return 0.1 * mass * _PROPELLER**2 * np.eye(3)


def _add_inertial(link: ET.Element, mass: float, centre: np.ndarray, inertia: np.ndarray) -> None:
    inertial = ET.SubElement(link, "inertial")
    ET.SubElement(inertial, "pose").text = _text(centre, np.zeros(3))
    ET.SubElement(inertial, "mass").text = repr(mass)
    about = ET.SubElement(inertial, "inertia")
    for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)):
        ET.SubElement(about, f"i{'xyz'[i]}{'xyz'[j]}").text = repr(float(inertia[i, j]))


def _add_system(model: ET.Element, kind: str, name: str) -> ET.Element:
    return ET.SubElement(model, "plugin", filename=f"gz-sim-{kind}-system", name=f"gz::sim::systems::{name}")


def _text(*vectors: np.ndarray) -> str:
    return " ".join(repr(float(value)) for vector in vectors for value in vector)
