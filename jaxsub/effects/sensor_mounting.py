"""Sensor effects of how and where a sensor sits in the body."""

from collections.abc import Mapping, Sequence
from typing import ClassVar

import equinox as eqx
import numpy as np
from jaxtyping import Array, Float

from ..arrays import namespace
from ..errors import InputError
from .base import AbstractInstrument, amplitude, of_output
from .motion import EQUATIONS, VELOCITIES, Facts, Motion, Signal, quantity_of, read_quantity

_TRIADS = (("u", "v", "w"), ("p", "q", "r"), ("ax", "ay", "az"))
_ARMED = (_TRIADS[0], ("x", "y", "z"), _TRIADS[2])
_EQUATIONS = {velocity: equation for equation, velocity in VELOCITIES.items()}
# the turning rates that move a sensor off the axis, by channel and axis
_TURNS = {
    "u": {"y": "r", "z": "q"}, "v": {"x": "r", "z": "p"}, "w": {"x": "q", "y": "p"},
    "x": {"x": "r", "y": "r", "z": "q"}, "y": {"x": "r", "y": "r", "z": "p"},
    "z": {"x": "q", "y": "p"}, "depth": {"x": "q", "y": "p"},
    "ax": {"x": "r", "y": "r", "z": "q"}, "ay": {"x": "r", "y": "r", "z": "p"}, "az": {"x": "q", "y": "p", "z": "q"},
}  # fmt: skip


class _Mounting(AbstractInstrument):
    """Of an instrument whose channels, one or more of a triad, are listed with commas between."""

    channel: eqx.AbstractVar[str]
    quantity: eqx.AbstractVar[str]

    @property
    def channels(self) -> tuple[str, ...]:
        """Those listed."""
        return tuple(self.channel.split(","))

    @property
    def shown(self) -> dict[str, tuple[str, float]]:
        """What each channel shows of the motion, and with which sign."""
        quantities = self.quantity.split(",") if self.quantity else [""] * len(self.channels)
        return {c: read_quantity(q, c)[:2] for c, q in zip(self.channels, quantities, strict=True)}


class SensorMisalignment(_Mounting):
    r"""A sensor turned towards another axis in its mounting: $z = y\cos\varepsilon + y_{other}\sin\varepsilon$.

    $\varepsilon$ in rad, of either sign; an amplitude while small. An instrument turned about one axis shows it in
    the other two, in `q,r` that see `r,q`: $z_q = q\cos\varepsilon + r\sin\varepsilon$,
    $z_r = r\cos\varepsilon - q\sin\varepsilon$. Of an attitude it is a bias, which is another effect.
    Source: Titterton and Weston (2004), §4; Groves (2013), §4.4.
    """

    name: ClassVar[str] = "sensor-misalignment"
    family: ClassVar[str] = "sensors"
    channel: str = eqx.field(static=True)
    sees: str = eqx.field(static=True)
    epsilon: Array = amplitude("rad")
    quantity: str = of_output()

    def __check_init__(self):
        seen = self.sees.split(",")
        known = {(a, b) for triad in _TRIADS for a in triad for b in triad if a != b}
        motions = {c: motion for c, (motion, _) in self.shown.items()}
        turned = {(motions[c], motions.get(s, s)) for c, s in zip(self.channels, seen, strict=False)}
        paired = len(seen) == len(self.channels) and turned <= known
        if not paired or (len(seen) > 1 and seen[::-1] != list(self.channels)):
            remedy = "name for a channel another axis of its triad, for two each other: channel = 'q,r', sees = 'r,q'"
            raise InputError(self.label, f"{self.channel} cannot see {self.sees}", remedy)

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[SensorMisalignment]":
        """Each velocity, rate and specific force of a body with the other two axes, where these move and are known.

        And any two of a triad, as one instrument has them.
        """
        free = [VELOCITIES[e] for e in facts.equations] if facts.kind == "submerged-body" else []
        known = [*free, *(c for c in facts.channels if c in _TRIADS[2])] if free else []
        make = lambda channel, sees: cls(channel=channel, sees=sees, quantity=quantity_of(channel, facts.quantities))
        triads = [(c, shown, triad) for c, shown in facts.shown.items() for triad in _TRIADS if shown in triad]
        alone = [make(c, other) for c, shown, triad in triads for other in triad if other != shown and other in known]
        moved = {*free, *({*facts.shown.values()} & {*_TRIADS[2]} if free else ())}
        pairs = [pair for a, b, c in _TRIADS for pair in ((b, c), (c, a), (a, b)) if {*pair} <= moved]
        turned = [own for pair in pairs for own in instruments(facts, pair) if len(own) == 2]
        return [*alone, *(make(",".join(own), ",".join(own[::-1])) for own in turned)]

    @property
    def expression(self) -> str:
        """The turned axes."""
        said = lambda c, other, sign: f"{c} measured = {c} cos ε {'-+'[sign > 0]} {other} sin ε"
        return ", ".join(said(*pair) for pair in self._pairs())

    def show(
        self, times: Float[Signal, " *k"], outputs: Mapping[str, Signal], motion: Motion
    ) -> dict[str, Float[Signal, " *k"]]:
        """The outputs along the turned axes."""
        true = {velocity: motion.rates[equation] for velocity, equation in _EQUATIONS.items()} | dict(outputs)
        xp = namespace(times, self.epsilon)
        own, across = xp.cos(self.epsilon), xp.sin(self.epsilon)
        return {c: xp.asarray(own * outputs[c] + sign * across * true[other]) for c, other, sign in self._pairs()}

    def _pairs(self) -> list[tuple[str, str, float]]:
        """Each channel, what it sees, and the sign."""
        signs = (1.0, -1.0)[: len(self.channels)]
        return list(zip(self.channels, self.sees.split(","), signs, strict=True))


class SensorLeverArm(_Mounting):
    r"""A sensor that sits a distance $l$ (m, either sign) along a body axis from where the model has it.

    A velocity sensor shows $\nu_1 + \nu_2\times l$, a position or depth sensor $\eta_1 + R\,l$, an accelerometer
    $f + \dot\nu_2\times l + \nu_2\times(\nu_2\times l)$. An instrument of several channels, such as `v,w`, has one arm.
    Source: Titterton and Weston (2004), §3; Groves (2013), §6.4.
    """

    name: ClassVar[str] = "sensor-lever-arm"
    family: ClassVar[str] = "sensors"
    # from one end to the other, and as much again beyond it
    reach: ClassVar[float | None] = 2.0
    channel: str = eqx.field(static=True)
    axis: str = eqx.field(static=True)
    arm: Array = amplitude("m")
    quantity: str = of_output()

    def __check_init__(self):
        what = f"no arm along {self.axis} shows in {self.channel}"
        if self.axis not in ("x", "y", "z"):
            raise InputError(self.label, what, "give the axis x, y or z")
        if not {motion for motion, _ in self.shown.values()} <= set(_TURNS):
            raise InputError(self.label, what, f"one shows in {', '.join(_TURNS)}")

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[SensorLeverArm]":
        """Each velocity, position and specific force of a body with the axes along which an arm shows.

        And those of a triad that an arm of one instrument shows in.
        """
        free = [VELOCITIES[e] for e in facts.equations] if facts.kind == "submerged-body" else []
        shows = lambda motion, axis: _TURNS.get(motion, {}).get(axis) in free
        make = lambda channel, axis: cls(channel=channel, axis=axis, quantity=quantity_of(channel, facts.quantities))
        alone = [make(c, axis) for c, motion in facts.shown.items() for axis in "xyz" if shows(motion, axis)]
        felt = [([c for c in triad if shows(c, x)], x) for triad in _ARMED for x in "xyz"]
        several = [(own, axis) for triad, axis in felt for own in instruments(facts, triad) if len(own) > 1]
        return [*alone, *(make(",".join(own), axis) for own, axis in several)]

    @property
    def expression(self) -> str:
        """The motion of the sensor about the origin."""
        said = {c: f"{'-+'[sign > 0]} {self._said(motion)}" for c, (motion, sign) in self.shown.items()}
        return ", ".join(f"{channel} measured = {channel} {arm}" for channel, arm in said.items())

    def _said(self, channel: str) -> str:
        if channel in _TRIADS[0]:
            return f"(ν2 × l_{self.axis})"
        if channel in _TRIADS[2]:
            return f"(dν2/dt × l_{self.axis} + ν2 × (ν2 × l_{self.axis}))"
        return f"(R l_{self.axis})"

    def show(
        self, times: Float[Signal, " *k"], outputs: Mapping[str, Signal], motion: Motion
    ) -> dict[str, Float[Signal, " *k"]]:
        """The outputs where the sensor is."""
        asarray = namespace(times, self.arm).asarray
        moved = {c: sign * self.arm * self._per_metre(name, motion) for c, (name, sign) in self.shown.items()}
        return {c: asarray(outputs[c] + part) for c, part in moved.items()}

    def _per_metre(self, channel: str, motion: Motion) -> Signal:
        xp = namespace(*(motion.rates[e] for e in EQUATIONS[3:]))
        unit = np.eye(3)["xyz".index(self.axis)]
        turning = xp.stack(xp.broadcast_arrays(*(motion.rates[e] for e in EQUATIONS[3:])), -1)
        moved = xp.cross(turning, xp.broadcast_to(unit, turning.shape))
        if channel in _TRIADS[0]:
            return moved[..., _TRIADS[0].index(channel)]
        if channel in _TRIADS[2]:
            still = xp.zeros_like(turning[..., 0])
            spin = xp.stack([motion.accelerations.get(e, still) for e in EQUATIONS[3:]], -1)
            felt = xp.cross(spin, xp.broadcast_to(unit, spin.shape)) + xp.cross(turning, moved)
            return felt[..., _TRIADS[2].index(channel)]
        return self._turned(channel, motion)

    def _turned(self, channel: str, motion: Motion) -> Signal:
        """Entry of R(φ, θ, ψ) by the position's row and the arm's column."""
        phi, theta, psi = (motion.positions[name] for name in ("phi", "theta", "psi"))
        xp = namespace(phi, theta, psi)
        level = {"x": xp.cos(theta), "y": xp.sin(theta) * xp.sin(phi), "z": xp.sin(theta) * xp.cos(phi)}[self.axis]
        across = {"x": xp.zeros_like(phi), "y": xp.cos(phi), "z": -xp.sin(phi)}[self.axis]
        if channel == "x":
            return level * xp.cos(psi) - across * xp.sin(psi)
        if channel == "y":
            return level * xp.sin(psi) + across * xp.cos(psi)
        return {"x": -xp.sin(theta), "y": xp.cos(theta) * xp.sin(phi), "z": xp.cos(theta) * xp.cos(phi)}[self.axis]


def instruments(facts: Facts, motions: Sequence[str]) -> list[list[str]]:
    """The channels that show some of `motions`, those of one instrument together: `dvl_u` and `dvl_v`, or `u` and `v`.

    Of one instrument are those whose names begin alike, up to the last `_`, and those that bear their motions' names.
    """
    found: dict[str, list[str]] = {}
    for motion in motions:
        for channel, shown in facts.shown.items():
            if shown == motion:
                instrument = "" if channel == motion else channel.rpartition("_")[0] or channel
                found.setdefault(instrument, []).append(channel)
    return list(found.values())
