"""What kinematics says of channels, without any model of forces: which rate belongs to which channel."""

import dataclasses
from collections.abc import Mapping

import numpy as np

from ..effects import GRAVITY, VELOCITIES
from ..vehicle import Layout

_EQUATION_OF = {velocity: equation for equation, velocity in VELOCITIES.items()}
_FREE_WITH = {"phi": "roll", "theta": "pitch", "psi": "yaw"}


@dataclasses.dataclass(frozen=True)
class Relation:
    """A channel and the rate that it should have.

    **Fields**

    - `channel`: whose changes are looked at; `partner`: the channel whose own rate that is, as `r` of `psi`, or the
      formula of several.
    - `values`, `rate`: (samples,), NaN where not known.
    - `direct`: whether `partner` is a single channel. `exact`: whether every term is measured or at rest.
    """

    channel: str
    partner: str
    values: np.ndarray
    rate: np.ndarray
    direct: bool
    exact: bool


class Motions:
    """The motions of a body in one run: measured, prescribed, locked, or not known."""

    def __init__(self, layout: Layout, columns: Mapping[str, np.ndarray], count: int, speed: float):
        prescribed = dict(layout.prescribed)
        self._columns = {name: columns[column] for name, column in prescribed.items() if column in columns}
        self._columns |= {name: columns[name] for name in layout.channels if name in columns}
        self._layout, self._zero, self._speed = layout, np.zeros(count), speed

    def measured(self, name: str) -> np.ndarray | None:
        """The samples of a motion, if it has a column with some."""
        values = self._columns.get(name)
        return None if values is None or not np.isfinite(values).any() else values

    def angle(self, name: str) -> np.ndarray | None:
        """The samples of an angle, if its turns are counted."""
        values = self.measured(name)
        if values is None or np.max(np.abs(np.diff(values[np.isfinite(values)])), initial=0.0) > np.pi:
            return None
        return values

    def known(self, name: str) -> np.ndarray | None:
        """The samples of a motion; zero, or the operating speed, where its degree of freedom is locked."""
        values = self.measured(name)
        if values is not None:
            return values
        equation = _EQUATION_OF.get(name, _FREE_WITH.get(name, ""))
        if equation and equation not in self._layout.equations and name not in dict(self._layout.prescribed):
            return self._zero + (self._speed if name == "u" else 0.0)
        return None

    def small(self, name: str) -> tuple[np.ndarray, bool]:
        """The samples of a motion and whether they are known; zero where not."""
        values = self.known(name)
        return (self._zero, False) if values is None else (values, True)


def body_relations(motions: Motions) -> list[Relation]:
    """Every relation of a body's channels for which the leading terms are measured."""
    found = [*_attitude(motions), *_vertical(motions), *_horizontal(motions), *_derived(motions)]
    return [*found, *_accelerations(motions)]


def mechanism_relations(layout: Layout, columns: Mapping[str, np.ndarray]) -> list[Relation]:
    """Each coordinate of a mechanism with its rate."""
    pairs = [(e, f"{e}_rate") for e in layout.equations if e in columns and f"{e}_rate" in columns]
    return [Relation(e, rate, columns[e], columns[rate], True, True) for e, rate in pairs]


def _attitude(motions: Motions) -> list[Relation]:
    phi, phi_known = motions.small("phi")
    theta, theta_known = motions.small("theta")
    q, q_known = motions.small("q")
    r, r_known = motions.small("r")
    p = motions.measured("p")
    turning = (q * np.sin(phi) + r * np.cos(phi)) / _away_from_zero(np.cos(theta))
    # what is not measured is taken as zero, and then less is concluded
    found = []
    for channel, partner, rate, exact in (
        ("psi", "r", turning, phi_known and theta_known and q_known),
        ("theta", "q", q * np.cos(phi) - r * np.sin(phi), phi_known and r_known),
        ("phi", "p", None if p is None else p + turning * np.sin(theta), theta_known and q_known and r_known),
    ):
        values = motions.angle(channel)
        if values is not None and rate is not None and motions.measured(partner) is not None:
            found.append(Relation(channel, partner, values, rate, True, exact))
    return found


def _vertical(motions: Motions) -> list[Relation]:
    (u, theta, w), found = (motions.known(name) for name in ("u", "theta", "w")), []
    if (
        u is None
        or theta is None
        or w is None
        or not any(motions.measured(name) is not None for name in ("w", "theta"))
    ):
        return []
    (phi, phi_known), (v, v_known) = motions.small("phi"), motions.small("v")
    sinking = -u * np.sin(theta) + (v * np.sin(phi) + w * np.cos(phi)) * np.cos(theta)
    for channel in ("z", "depth"):
        values = motions.measured(channel)
        if values is not None:
            exact = phi_known and v_known
            found.append(Relation(channel, "-u sin(theta) + w cos(theta)", values, sinking, False, exact))
    return found


def _horizontal(motions: Motions) -> list[Relation]:
    u, psi = motions.known("u"), motions.measured("psi")
    if u is None or psi is None:
        return []
    motion = {name: motions.small(name) for name in ("v", "w", "phi", "theta")}
    v, w, phi, theta = (motion[name][0] for name in ("v", "w", "phi", "theta"))
    exact = all(known for _, known in motion.values())
    across = v * np.cos(phi) - w * np.sin(phi)
    ahead = u * np.cos(theta) + (v * np.sin(phi) + w * np.cos(phi)) * np.sin(theta)
    rates = {
        "x": (ahead * np.cos(psi) - across * np.sin(psi), "u cos(psi) - v sin(psi)"),
        "y": (ahead * np.sin(psi) + across * np.cos(psi), "u sin(psi) + v cos(psi)"),
    }
    return [
        Relation(name, formula, values, rate, False, exact)
        for name, (rate, formula) in rates.items()
        if (values := motions.measured(name)) is not None
    ]


def _derived(motions: Motions) -> list[Relation]:
    found = []
    for channel, partner in (("z", "depth_rate"), ("depth", "depth_rate"), ("psi", "heading_rate")):
        values, rate = (
            motions.angle(channel) if channel == "psi" else motions.measured(channel),
            motions.measured(partner),
        )
        if values is not None and rate is not None:
            found.append(Relation(channel, partner, values, rate, True, True))
    return found


def _accelerations(motions: Motions) -> list[Relation]:
    """Velocities with accelerometers, away from the centre of gravity only roughly."""
    motion = {name: motions.small(name) for name in ("u", "v", "w", "p", "q", "r", "phi", "theta")}
    u, v, w, p, q, r, phi, theta = (values for values, _ in motion.values())
    gravity = (-np.sin(theta), np.sin(phi) * np.cos(theta), np.cos(phi) * np.cos(theta))
    turned = (q * w - r * v, r * u - p * w, p * v - q * u)
    found = []
    for i, (velocity, axis) in enumerate((("u", "ax"), ("v", "ay"), ("w", "az"))):
        values, force = motions.measured(velocity), motions.measured(axis)
        if values is not None and force is not None:
            rate = force - turned[i] + GRAVITY * gravity[i]
            found.append(Relation(velocity, f"{axis} less gravity and turning", values, rate, False, False))
    return found


def _away_from_zero(cosine: np.ndarray) -> np.ndarray:
    """A cosine, NaN where it is so small that noise of the angle counts for much."""
    return np.where(np.abs(cosine) < 0.3, np.nan, cosine)
