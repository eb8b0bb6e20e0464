"""Kinematic relations between channels, without any model of forces: which rate belongs to which channel."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ..effects import GRAVITY, VELOCITIES
from ..vehicle import Layout

_EQUATION_OF = {velocity: equation for equation, velocity in VELOCITIES.items()}
_FREE_WITH = {"phi": "roll", "theta": "pitch", "psi": "yaw"}
_EULER = ("phi", "theta", "psi")


@dataclasses.dataclass(frozen=True)
class Motions:
    """The motions of a vehicle in one run: measured, prescribed, locked, or not known.

    **Fields**

    - `columns`: the samples (..., samples) of each motion that is measured or prescribed, NaN where missing.
    - `constants`: the value of each motion whose degree of freedom is locked.
    """

    columns: Mapping[str, np.ndarray]
    constants: Mapping[str, float]

    @classmethod
    def of(cls, layout: Layout, columns: Mapping[str, np.ndarray], speed: float) -> "Motions":
        """The motions of a run with the samples `columns`; `speed` (m/s) is that of a body whose surge is locked."""
        prescribed = dict(layout.prescribed)
        named = {name: columns[column] for name, column in layout.plain.items() if column in columns}
        there = {name: values for name, values in named.items() if np.isfinite(values).any()}
        every = {**_EQUATION_OF, **_FREE_WITH} if layout.kind == "submerged-body" else {}
        locked = [n for n, equation in every.items() if equation not in layout.equations and n not in prescribed]
        return cls(there, {name: speed if name == "u" else 0.0 for name in locked if name not in there})

    def knows(self, *names: str) -> bool:
        """Whether all these motions are measured, prescribed or locked."""
        return all(name in self.columns or name in self.constants for name in names)

    def __getitem__(self, name: str) -> np.ndarray:
        """The samples (..., samples) of a motion; zero where it is not known."""
        if name in self.columns:
            return self.columns[name]
        return np.full(next(iter(self.columns.values())).shape[-1:], self.constants.get(name, 0.0))

    def replaced(self, columns: Mapping[str, np.ndarray]) -> "Motions":
        """These motions with other samples of some."""
        return dataclasses.replace(self, columns={**self.columns, **columns})


@dataclasses.dataclass(frozen=True)
class Relation:
    """A channel and the rate that kinematics gives it.

    **Fields**

    - `channel`: whose changes are looked at; `partner`: the channel whose own rate that is, as `r` of `psi`, or the
      formula of several.
    - `rate`: gives the rate (..., samples) of `channel` from the motions.
    - `among`: the measured channels that take part, `channel` included.
    - `direct`: whether `partner` is a single channel. `exact`: whether every term is measured or at rest.
    - `arms`: gives what a sensor 1 m off the origin along each body axis adds to `channel`, (..., samples) each; None
      for angles and their rates, which have no arm.
    - `leaks`: gives the rates (..., samples) of which a gyro that is mounted 1 rad askew adds to this one; None where
      they are not measured.
    - `offset`: the largest mean of the rate (unit of `channel` a second) that is no fault, such as a current's; that
      of a direct relation is a share of the rate itself.
    """

    channel: str
    partner: str
    rate: Callable[[Motions], np.ndarray]
    among: frozenset[str]
    direct: bool
    exact: bool
    arms: Callable[[Motions], Sequence[np.ndarray]] | None = None
    offset: float = 0.0
    leaks: Callable[[Motions], Sequence[np.ndarray]] | None = None


def body_relations(motions: Motions) -> list[Relation]:
    """Every relation of a body's channels for which the leading terms are known."""
    return [*_attitude(motions), *_position(motions), *_derived(motions), *_accelerations(motions)]


def mechanism_relations(layout: Layout, motions: Motions) -> list[Relation]:
    """Each coordinate of a mechanism with its rate."""
    pairs = [(e, f"{e}_rate") for e in layout.equations if {e, f"{e}_rate"} <= set(motions.columns)]
    return [_direct(motions, channel, rate) for channel, rate in pairs]


def _direct(motions: Motions, channel: str, partner: str) -> Relation:
    return Relation(channel, partner, lambda m: m[partner], frozenset({channel, partner}), True, True)


def _attitude(motions: Motions) -> list[Relation]:
    def turning(m: Motions) -> np.ndarray:
        return (m["q"] * np.sin(m["phi"]) + m["r"] * np.cos(m["phi"])) / _away_from_zero(np.cos(m["theta"]))

    def leaking(*names: str) -> Callable[[Motions], Sequence[np.ndarray]] | None:
        there = [name for name in names if name in motions.columns]
        return (lambda m: [m[name] for name in there]) if there else None

    rates = {
        "psi": ("r", turning, ("phi", "theta", "q")),
        "theta": ("q", lambda m: m["q"] * np.cos(m["phi"]) - m["r"] * np.sin(m["phi"]), ("phi", "r")),
        "phi": ("p", lambda m: m["p"] + turning(m) * np.sin(m["theta"]), ("theta", "q", "r")),
    }
    return [
        # what is not known is taken as zero, and then less is concluded
        Relation(
            channel,
            partner,
            rate,
            _among(motions, channel, partner, *others),
            True,
            motions.knows(*others),
            leaks=leaking(*(name for name in ("p", "q", "r") if name != partner)),
        )
        for channel, (partner, rate, others) in rates.items()
        if {channel, partner} <= set(motions.columns) and _counted(motions[channel])
    ]


def _position(motions: Motions) -> list[Relation]:
    """x, y and z with the velocities, turned from body axes to the earth's."""
    found = []
    formulas = {
        "x": (0, "u cos(psi) - v sin(psi)", ("u", "psi"), 2.0),
        "y": (1, "u sin(psi) + v cos(psi)", ("u", "psi"), 2.0),
        "z": (2, "-u sin(theta) + w cos(theta)", ("u", "theta", "w"), 0.3),
        "depth": (2, "-u sin(theta) + w cos(theta)", ("u", "theta", "w"), 0.3),
    }
    for channel, (row, formula, leading, offset) in formulas.items():
        moving = any(name in motions.columns for name in leading)
        if channel not in motions.columns or not motions.knows(*leading) or not moving:
            continue

        def rate(m: Motions, row: int = row) -> np.ndarray:
            along, across, down = _axes(m, row)
            return along * m["u"] + across * m["v"] + down * m["w"]

        others = ("u", "v", "w", "phi", "theta", "psi") if row < 2 else ("u", "v", "w", "phi", "theta")
        among, exact = _among(motions, channel, *others), motions.knows(*others)
        arms = lambda m, row=row, channel=channel: np.broadcast_arrays(*_axes(m, row), m[channel])[:3]
        found.append(Relation(channel, formula, rate, among, False, exact, arms, offset))
    return found


def _axes(motions: Motions, row: int) -> list[np.ndarray]:
    """The components of the body's axes along x, y or z of the earth: a row of the rotation matrix."""
    # one number for an angle that is locked: a search compares hundreds of times
    angles = [motions.columns.get(name, np.float64(motions.constants.get(name, 0.0))) for name in _EULER]
    (sf, st, sp), (cf, ct, cp) = ([f(angle) for angle in angles] for f in (np.sin, np.cos))
    rows = (
        lambda: [cp * ct, cp * st * sf - sp * cf, cp * st * cf + sp * sf],
        lambda: [sp * ct, sp * st * sf + cp * cf, sp * st * cf - cp * sf],
        lambda: [-st, ct * sf, ct * cf],
    )
    return rows[row]()


def _derived(motions: Motions) -> list[Relation]:
    pairs = (("z", "depth_rate"), ("depth", "depth_rate"), ("psi", "heading_rate"))
    there = [pair for pair in pairs if {*pair} <= set(motions.columns)]
    return [_direct(motions, *pair) for pair in there if pair[0] != "psi" or _counted(motions["psi"])]


def _accelerations(motions: Motions) -> list[Relation]:
    """Velocities with accelerometers, which gravity's share of a small misalignment makes rough."""

    def turned(m: Motions) -> tuple[np.ndarray, ...]:
        u, v, w, p, q, r = (m[name] for name in ("u", "v", "w", "p", "q", "r"))
        return q * w - r * v, r * u - p * w, p * v - q * u

    found = []
    for i, (velocity, force) in enumerate((("u", "ax"), ("v", "ay"), ("w", "az"))):
        if not {velocity, force} <= set(motions.columns):
            continue

        def rate(m: Motions, i: int = i, force: str = force) -> np.ndarray:
            return m[force] - turned(m)[i] + GRAVITY * _axes(m, 2)[i]

        def arms(m: Motions, i: int = i) -> Sequence[np.ndarray]:
            p, q, r = (m[name] for name in ("p", "q", "r"))
            return [[0.0 * p, r, -q], [-r, 0.0 * p, p], [q, -p, 0.0 * p]][i]

        among = _among(motions, velocity, force, "u", "v", "w", "p", "q", "r", "phi", "theta")
        partner = f"{force} less gravity and turning"
        found.append(Relation(velocity, partner, rate, among, False, False, arms, np.inf))
    return found


def _among(motions: Motions, *names: str) -> frozenset[str]:
    return frozenset(name for name in names if name in motions.columns)


def _counted(angle: np.ndarray) -> bool:
    """Whether the turns of an angle are counted, so that its changes are known."""
    return float(np.max(np.abs(np.diff(angle[np.isfinite(angle)])), initial=0.0)) <= np.pi


def _away_from_zero(cosine: np.ndarray) -> np.ndarray:
    """A cosine, NaN where it is so small that noise of the angle counts for much."""
    return np.where(np.abs(cosine) < 0.3, np.nan, cosine)
