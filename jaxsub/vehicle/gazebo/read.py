"""Gazebo models in: SDF to a vehicle."""

import re
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError
from ..inertia import twin
from ..read import vehicle_from
from ..submerged_body import SubmergedBody
from ..usual_sensors import OUTPUTS
from .sdf import Model, flag, number, numbers, parsed
from .terms import CORIOLIS, FLIP, symbol

_GRAVITY, _DENSITY = 9.8, 1000.0  # of a world and of the buoyancy system that state none
_LARGEST_THRUST = 1000.0  # N or rad/s, of a thruster that states none
_PROPELLER = (("propeller_diameter", 0.02), ("fluid_density", 1000.0))  # and what they are where it states none
_NO_MOTION = ("namespace", "link_name", "water_density", "waterDensity")
_OF_THRUSTER = (
    "namespace", "topic", "joint_name", "thrust_coefficient", "propeller_diameter", "fluid_density", "use_angvel_cmd",
    "max_thrust_cmd", "min_thrust_cmd", "velocity_control", "p_gain", "i_gain", "d_gain",
)  # fmt: skip


def read_sdf(path: str | Path) -> tuple[SubmergedBody, list[str]]:
    r"""The vehicle of the first model with a hydrodynamics system in the SDF file `path`, and what it lacks of it.

    Coefficients are those of the plugin in axes with z down. Its Coriolis forces of added mass, which in Gazebo
    Harmonic have other signs than Fossen's (`terms.CORIOLIS`), are derivatives tied to added mass. All links move as
    one body, about the origin of the link that the plugin names. Buoyancy is that of the collision shapes, $\rho gV$;
    thrusters push where and along the axis that their joints say, by a force (N) or a shaft speed (rad/s).

    **Raises** `InputError` for what is no such file, and where it contradicts itself.
    """
    path = Path(path)
    root, where = parsed(path), str(path)
    plugins = [(one, _system(one, "hydrodynamics")) for one in root.iter("model")]
    element, plugin = next(((one, found) for one, found in plugins if found is not None), (None, None))
    if element is None or plugin is None:
        raise InputError(where, "has no model with a gz-sim-hydrodynamics-system", "add the plugin to the model")
    model = Model(element, where)
    base = (plugin.findtext("link_name") or "").strip()
    model.named(base, "link", f"{where}: hydrodynamics.link_name")
    lost = _not_translated(root, element, plugin)
    gravity = _gravity(root, where)
    data: dict[str, Any] = {"schema": 1, "name": element.get("name") or path.stem, "kind": "submerged-body"}
    data["body"] = _body(model, base, _density(root, where), gravity, lost)
    data["model"] = {"coriolis": "rigid-body"}
    data["coefficients"] = _coefficients(plugin, where)
    data["inputs"], data["actuators"] = _thrusters(model, base, lost)
    data["outputs"] = OUTPUTS
    vehicle = vehicle_from(data, where)
    assert isinstance(vehicle, SubmergedBody)
    return vehicle, lost


def _system(element: ET.Element, kind: str) -> ET.Element | None:
    """The first plugin of that kind in an element."""
    return next((one for one in element.findall("plugin") if _is(one, kind)), None)


def _is(plugin: ET.Element, kind: str) -> bool:
    """Whether a plugin is Gazebo's system of that kind, under its present name or that of Ignition."""
    named = rf"(?:lib)?(?:gz-sim|ignition-gazebo)\d*-{kind}-system(?:\.so)?"
    return re.fullmatch(named, plugin.get("filename", "")) is not None


def _gravity(root: ET.Element, where: str) -> float:
    given = root.find("world/gravity")
    if given is None:
        return _GRAVITY
    x, y, z = numbers(given.text, 3, f"{where}: gravity")
    if x or y or not z < 0.0:
        raise InputError(f"{where}: gravity", f"is {(given.text or '').strip()!r:.60}", "give one along -z")
    return float(-z)


def _density(root: ET.Element, where: str) -> float:
    """Of the water, kg/m³: the buoyancy system's."""
    found = next((one for one in root.iter("plugin") if _is(one, "buoyancy")), None)
    if found is None:
        return _DENSITY
    graded = found.find("graded_buoyancy")
    if graded is not None:
        return number(graded, "default_density", _DENSITY, where)
    return number(found, "uniform_fluid_density", _DENSITY, where)


def _body(model: Model, base: str, density: float, gravity: float, lost: list[str]) -> dict[str, Any]:
    mass, centre, inertia = model.lumped(base)
    volume, buoyant, unknown = model.displaced(base)
    lost += [f"{one}: its volume is unknown" for one in unknown]
    if not volume:
        lost.append("buoyancy: no collision shape has a volume, so it is the weight, at the centre of gravity")
        volume, buoyant = mass / density, centre
    size = float(np.trace(inertia))
    apart = inertia - np.diag(np.diag(inertia))
    if np.abs(apart).max() > 1e-9 * size:
        said = ", ".join(f"{value:.4g}" for value in apart[np.triu_indices(3, 1)])
        lost.append(f"products of inertia ixy, ixz, iyz = {said} kg m²")
    return {
        "mass": mass,
        "weight": mass * gravity,
        "buoyancy": density * gravity * volume,
        "inertia": np.diag(inertia).tolist(),
        "centre_of_gravity": (FLIP @ centre).tolist(),
        "centre_of_buoyancy": (FLIP @ buoyant).tolist(),
        "reference_density": density,
    }


def _coefficients(plugin: ET.Element, where: str) -> dict[str, Any]:
    """Derivatives; those that follow from added mass as expressions."""
    values: dict[str, float] = {}
    for element in plugin:
        if named := symbol(element.tag):
            name, sign = named
            value = float(numbers(element.text, 1, f"{where}: hydrodynamics.{element.tag}")[0])
            values[name] = values.get(name, 0.0) + sign * value
    added = {name: value for name, value in values.items() if name.endswith("dot") and value}
    products: dict[str, Any] = {n: value for n, value in values.items() if value and not n.endswith("dot")}
    if not flag(plugin, "disable_coriolis"):
        with_mass = not flag(plugin, "disable_added_mass")
        for name, text in CORIOLIS.items():
            terms = [(sign, one) for sign, one in re.findall(r"(-?) ?([A-Z]_[a-z]dot)", text) if one in added]
            if not terms:
                continue
            if with_mass:
                said = " ".join(f"{sign or '+'} {one}" for sign, one in terms)
                said = said.removeprefix("+ ") if said[0] == "+" else f"-{said[2:]}"
                products[name] = f"{said} + {products[name]!r}" if name in products else said
            else:
                carried = sum(-added[one] if sign else added[one] for sign, one in terms)
                products[name] = products.get(name, 0.0) + carried
    if flag(plugin, "disable_added_mass"):
        return products
    # one that is given on one side alone stands for both, and Gazebo has just that one
    both = {one: added.get(one, 0.0) for name in added for one in (name, twin(name))}
    return {name: {"value": value, "fixed": True} for name, value in both.items()} | products


def _thrusters(model: Model, base: str, lost: list[str]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Inputs and actuators of the thruster systems."""
    inputs, actuators, origin = {}, {}, model.pose(base).inverse()
    for plugin in model.element.findall("plugin"):
        if not _is(plugin, "thruster"):
            continue
        joint = (plugin.findtext("joint_name") or "").strip()
        place = f"{model.where}: thruster {joint}"
        element = model.named(joint, "joint", place)
        child = (element.findtext("child") or "").strip()
        model.named(child, "link", place)
        axis = element.find("axis/xyz")
        along = numbers("0 0 1" if axis is None else axis.text, 3, f"{place}: axis")
        frame = joint if axis is None else axis.get("expressed_in") or joint
        direction = origin.turn @ model.pose(frame).turn @ along
        if not np.linalg.norm(direction):
            raise InputError(f"{place}: axis", "has no length", "mend the file")
        name = re.sub(r"\W", "_", joint.removesuffix("_joint"))
        name = name if name.isidentifier() and name not in inputs else f"thruster_{len(inputs) + 1}"
        low = number(plugin, "min_thrust_cmd", -_LARGEST_THRUST, place)
        high = number(plugin, "max_thrust_cmd", _LARGEST_THRUST, place)
        if not low < high:  # as Gazebo does
            low, high = -_LARGEST_THRUST, _LARGEST_THRUST
        actuators[name] = {
            "kind": "thruster",
            "position": (FLIP @ (origin @ model.pose(child)).place).tolist(),
            "direction": (FLIP @ direction / np.linalg.norm(direction)).tolist(),
            "limits": [low, high],
        }
        turned = flag(plugin, "use_angvel_cmd")
        if turned:
            diameter, water = (number(plugin, *of, place) for of in _PROPELLER)
            actuators[name]["forward"] = number(plugin, "thrust_coefficient", 1.0, place) * water * diameter**4
        inputs[name] = {"column": name, "unit": "rad/s" if turned else "N"}
        kept = (*_OF_THRUSTER, *(() if turned else ("wake_fraction", "alpha_1", "alpha_2")))
        lost += [f"thruster {joint}: {one.tag}" for one in plugin if one.tag not in kept]
    return inputs, actuators


def _not_translated(root: ET.Element, model: ET.Element, plugin: ET.Element) -> list[str]:
    """What of the file has no part in the vehicle, by name."""
    known = (*_NO_MOTION, "disable_coriolis", "disable_added_mass")
    lost = [f"hydrodynamics: {one.tag}" for one in plugin if not symbol(one.tag) and one.tag not in known]
    for one in root.iter("plugin"):
        kinds = ("thruster", "buoyancy")
        if one is not plugin and not any(_is(one, kind) for kind in kinds):
            target = one.findtext("link_name") or one.findtext("joint_name") or ""
            lost.append(f"plugin {one.get('filename') or one.get('name')}{f' ({target.strip()})' if target else ''}")
        if _is(one, "buoyancy"):
            lost += [f"buoyancy: {part.tag}" for part in one.iter() if part.tag in ("density_change", "enable")]
    lost += [f"joint {one.get('name')}: taken as fixed" for one in model.findall("joint") if one.get("type") != "fixed"]
    lost += [f"model {one.get('name')}" for one in root.iter("model") if one is not model]
    lost += [f"include {(one.findtext('uri') or '').strip()}" for one in root.iter("include")]
    lost += [f"sensor {one.get('name')}" for one in model.iter("sensor")]
    lost += [
        f"fluid_added_mass of {one.get('name')}"
        for one in model.findall("link")
        if one.find("inertial/fluid_added_mass") is not None
    ]
    return lost
