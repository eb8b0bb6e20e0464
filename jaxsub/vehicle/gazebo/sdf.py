"""SDF files in: the elements of a model, their poses, and the mass and volume of its links."""

import dataclasses
import math
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np

from ...errors import InputError

_LARGEST = 4_000_000  # bytes
_DEEPEST = 50  # frames that are given relative to each other


@dataclasses.dataclass(frozen=True)
class Pose:
    """A place (3,), m, and a rotation matrix (3, 3), in axes with z up."""

    place: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(3))
    turn: np.ndarray = dataclasses.field(default_factory=lambda: np.eye(3))

    def __matmul__(self, other: "Pose") -> "Pose":
        """What is at `other` in this frame."""
        return Pose(self.place + self.turn @ other.place, self.turn @ other.turn)

    def inverse(self) -> "Pose":
        """This frame's parent in it."""
        return Pose(-self.turn.T @ self.place, self.turn.T)


def parsed(path: Path) -> ET.Element:
    """The root of the SDF file at `path`.

    **Raises** `InputError` for what is no XML in UTF-8, is too large, or declares a document type or entities.
    """
    where = str(path)
    try:
        if path.stat().st_size > _LARGEST:
            raise InputError(where, f"has more than {_LARGEST / 1e6:.0f} MB", "give a model's SDF file")
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(where, "is not text", "give an SDF file in UTF-8") from error
    except OSError as error:
        raise InputError(where, f"cannot be read ({error.strerror})", "give the path of an SDF file") from error
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise InputError(where, "declares a document type or entities", "delete them; SDF has none")
    try:
        root = ET.fromstring(text)
    except (ET.ParseError, ValueError) as error:
        raise InputError(where, f"is no XML: {error}", "give an SDF file") from error
    if root.tag != "sdf":
        raise InputError(where, f"begins with <{root.tag:.60}>", "give an SDF file, which begins with <sdf>")
    return root


def numbers(text: str | None, count: int, place: str) -> np.ndarray:
    """The `count` numbers of an element's text. **Raises** `InputError` for anything else."""
    try:
        found = np.array([float(word) for word in (text or "").split()])
    except ValueError:
        found = np.zeros(0)
    if found.shape != (count,) or not np.isfinite(found).all():
        raise InputError(place, f"{(text or '').strip()!r:.60} is not {count} numbers", "mend the file")
    return found


def number(element: ET.Element, key: str, default: float, where: str) -> float:
    """The number in the child `key` of an element."""
    found = element.find(key)
    return default if found is None else float(numbers(found.text, 1, f"{where}: {element.tag}.{key}")[0])


def flag(element: ET.Element, key: str) -> bool:
    """Whether the child `key` says true."""
    return (element.findtext(key) or "").strip().lower() in ("true", "1")


class Model:
    """The model of an SDF file, with its frames."""

    def __init__(self, element: ET.Element, where: str) -> None:
        self.element, self.where = element, where
        kinds = ("link", "joint", "frame")
        self._frames = {one.get("name", ""): one for kind in kinds for one in element.findall(kind)}

    @property
    def links(self) -> dict[str, ET.Element]:
        """Links by name."""
        return {one.get("name", ""): one for one in self.element.findall("link")}

    def named(self, name: str, kind: str, place: str) -> ET.Element:
        """The link or joint of that `name`. **Raises** `InputError` where there is none."""
        found = self._frames.get(name)
        if found is None or found.tag != kind:
            raise InputError(place, f"names the {kind} {name!r:.60}, and the model has none", "mend the file")
        return found

    def pose(self, name: str, depth: int = 0) -> Pose:
        """The pose of a link, joint or frame in the model's frame."""
        if name == "__model__":
            return Pose()
        place = f"{self.where}: {name}"
        if name not in self._frames or depth > _DEEPEST:
            what = "is no link, joint or frame of the model" if depth <= _DEEPEST else "is given relative to itself"
            raise InputError(place, what, "mend the poses of the file")
        element = self._frames[name]
        child = (element.findtext("child") or "").strip()
        default = {"joint": child, "frame": element.get("attached_to") or "__model__"}.get(element.tag, "__model__")
        given = element.find("pose")
        relative = default if given is None else given.get("relative_to") or default
        return self.pose(relative, depth + 1) @ read_pose(given, place)

    def lumped(self, base: str) -> tuple[float, np.ndarray, np.ndarray]:
        """Mass (kg) of all links, and their centre (3,) and inertia (3, 3) about the origin of the link `base`."""
        mass, moment, inertia = 0.0, np.zeros(3), np.zeros((3, 3))
        origin = self.pose(base).inverse()
        for name, link in self.links.items():
            own, centre, about = _inertial(link, f"{self.where}: {name}")
            at = origin @ self.pose(name) @ centre
            mass, moment = mass + own, moment + own * at.place
            inertia += at.turn @ about @ at.turn.T + own * steiner(at.place)
        return mass, moment / mass, inertia

    def displaced(self, base: str) -> tuple[float, np.ndarray, list[str]]:
        """Volume (m³) of all collision shapes, its centre (3,) in the link `base`, and the shapes of unknown volume."""
        volume, moment, unknown = 0.0, np.zeros(3), []
        origin = self.pose(base).inverse()
        for name, link in self.links.items():
            for collision in link.findall("collision"):
                place = f"{self.where}: {name}.{collision.get('name')}"
                own = _volume(collision.find("geometry"), place)
                if own is None:
                    unknown.append(f"collision {name}/{collision.get('name')}")
                    continue
                at = origin @ self.pose(name) @ read_pose(collision.find("pose"), place)
                volume, moment = volume + own, moment + own * at.place
        return volume, moment / volume if volume else moment, unknown


def steiner(place: np.ndarray) -> np.ndarray:
    """Inertia (3, 3) per kg of a point at `place` (3,)."""
    return place @ place * np.eye(3) - np.outer(place, place)


def read_pose(element: ET.Element | None, place: str) -> Pose:
    """The pose that an element says, in the frame it is relative to. **Raises** `InputError` for quaternions."""
    if element is None or not (element.text or "").strip():
        return Pose()
    if element.get("rotation_format", "euler_rpy") != "euler_rpy":
        raise InputError(place, "has a pose with a quaternion", "give roll, pitch and yaw")
    values = numbers(element.text, 6, f"{place}: pose")
    angles = np.radians(values[3:]) if element.get("degrees") == "true" else values[3:]
    (sr, sp, sy), (cr, cp, cy) = np.sin(angles), np.cos(angles)
    turn = np.array([
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ])  # fmt: skip
    return Pose(values[:3], turn)


def _inertial(link: ET.Element, where: str) -> tuple[float, Pose, np.ndarray]:
    """Mass, pose of the centre of mass, and inertia about it; those of SDF where absent."""
    element = link.find("inertial")
    if element is None:
        return 1.0, Pose(), np.eye(3)
    if element.get("auto") == "true":
        raise InputError(f"{where}: inertial", "is to be computed by Gazebo", "write mass and inertia out")
    about = element.find("inertia")
    about = ET.Element("inertia") if about is None else about
    value = lambda key: number(about, key, 1.0 if key[1] == key[2] else 0.0, where)
    xx, yy, zz, xy, xz, yz = map(value, ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"))
    mass = number(element, "mass", 1.0, where)
    if not mass > 0.0:
        raise InputError(f"{where}: mass", f"is {mass:g}", "give a positive number")
    return mass, read_pose(element.find("pose"), where), np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _volume(geometry: ET.Element | None, place: str) -> float | None:
    """Volume of a shape, m³; None where it cannot be said, as of a mesh."""
    shape = None if geometry is None else next(iter(geometry), None)
    if shape is None:
        return None
    size = lambda key, count=1: numbers(shape.findtext(key), count, f"{place}: {shape.tag}.{key}")
    if shape.tag == "box":
        return float(np.prod(size("size", 3)))
    if shape.tag == "ellipsoid":
        return float(4.0 / 3.0 * math.pi * np.prod(size("radii", 3)))
    if shape.tag not in ("sphere", "cylinder", "capsule"):
        return None
    radius = float(size("radius")[0])
    ball = 4.0 / 3.0 * math.pi * radius**3 if shape.tag != "cylinder" else 0.0
    return ball + (math.pi * radius**2 * float(size("length")[0]) if shape.tag != "sphere" else 0.0)
