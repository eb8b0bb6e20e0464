"""The autopilots of course rate, depth and roll as one that shares out the fins."""

import math
from collections.abc import Mapping

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from ..errors import InputError
from ..parameters import number
from ..vehicle import AbstractVehicle
from .limits import FinLimits
from .loops import Loop
from .steering import PAIR, CourseRate, Depth, Roll, depth_of

PITCH_LIMIT = math.radians(30.0)
REFERENCES = ("course_rate", "depth", "roll")


class AutopilotMemory(eqx.Module):
    """What an autopilot remembers.

    **Fields**

    - `deflections`: rad, that it ended with. `held`: the integral of each loop, SI.
    - `depth`: m, that it was shown. `fresh`: whether it has not yet been shown anything.
    """

    deflections: dict[str, Float[Array, ""]]
    held: dict[str, Float[Array, ""]]
    depth: Float[Array, ""]
    fresh: Bool[Array, ""]


class Autopilot(eqx.Module):
    """The three autopilots on the fins they share; one that is absent leaves its fins to others.

    **Fields**

    - `course`, `depth`, `roll`: the autopilots. `limits`: of each fin.
    """

    course: CourseRate | None
    depth: Depth | None
    roll: Roll | None
    limits: dict[str, FinLimits]

    @classmethod
    def of(
        cls, vehicle: AbstractVehicle, limits: FinLimits | None = None, pitch_limit: float = PITCH_LIMIT
    ) -> "Autopilot":
        """An autopilot for each of yaw and pitch that `vehicle` is free in, and for roll if its elevators part.

        All fins have the same `limits`, those of `FinLimits.of()` if none are given; `pitch_limit` in rad.

        **Raises** `InputError` for a vehicle that lacks the actuator, or that is free in neither.
        """
        limits = FinLimits.of() if limits is None else limits
        layout = vehicle.layout
        free = layout.equations if layout.kind == "submerged-body" else ()
        course = CourseRate.of(vehicle, limits) if "yaw" in free else None
        depth = Depth.of(vehicle, limits, float(pitch_limit)) if "pitch" in free else None
        if course is None and depth is None:
            raise InputError(layout.name, "is free in neither yaw nor pitch", "steer it by hand")
        split = depth is not None and depth.fins == PAIR and "roll" in free
        roll = Roll.of(vehicle, limits) if split else None
        fins = (*(("rudder",) if course else ()), *(depth.fins if depth else ()))
        return cls(course, depth, roll, {name: limits for name, _ in layout.inputs if name in fins})

    @property
    def channels(self) -> tuple[tuple[str, ...], ...]:
        """The channels to show it; of each group any one."""
        yaw = (("r",),) if self.course else ()
        pitch = (("z", "depth"), ("theta",), ("q",)) if self.depth else ()
        return yaw + pitch + ((("phi",), ("p",)) if self.roll else ())

    def init(self) -> AutopilotMemory:
        """The memory at the start: fins and integrals at zero."""
        zeros = lambda names: {name: number(0.0) for name in names}
        return AutopilotMemory(
            zeros(self.limits), zeros(("yaw", "depth", "pitch", "roll")), number(0.0), jnp.asarray(True)
        )

    def command(
        self,
        memory: AutopilotMemory,
        shown: Mapping[str, Array],
        reference: Mapping[str, Array],
        dt: Float[Array, ""] | float,
        override: Mapping[str, Array] | None = None,
    ) -> tuple[AutopilotMemory, dict[str, Array]]:
        """The memory and the deflections (rad) by fin, `dt` s after the last.

        `shown` are measured channels, of which it needs `channels`; `reference` holds `course_rate` (rad/s), `depth`
        (m) and `roll` (rad), those that there is an autopilot for. A fin in `override` is commanded that
        deflection instead; it keeps its limits.
        """
        errors, asked, cut, depth = {}, {}, {}, memory.depth
        if self.course is not None:
            errors["yaw"] = self.course.error(shown, reference)
            asked["yaw"] = self.course.loop.demand(errors["yaw"], memory.held["yaw"], shown["r"])
        if self.depth is not None:
            depth = depth_of(shown)
            descent = jnp.where(memory.fresh, 0.0, depth - memory.depth) / dt
            known = self.depth.errors(memory.held["depth"], shown, reference, descent)
            errors["pitch"], errors["depth"], cut["depth"] = known
            asked["pitch"] = self.depth.inner.demand(errors["pitch"], memory.held["pitch"], shown["q"])
        if self.roll is not None:
            errors["roll"] = reference["roll"] - shown["phi"]
            asked["roll"] = self.roll.loop.demand(errors["roll"], memory.held["roll"], shown["p"])
        commanded = self._shared(asked) | dict(override or {})
        done = {name: fin.apply(commanded[name], memory.deflections[name], dt) for name, fin in self.limits.items()}
        cut |= {name: demand - self._achieved(done)[name] for name, demand in asked.items()}
        held = memory.held | {
            name: loop.integrate(memory.held[name], errors[name], cut[name], dt) for name, loop in self._loops().items()
        }
        return AutopilotMemory(done, held, depth, jnp.asarray(False)), done

    def _loops(self) -> dict[str, Loop]:
        loops = {"yaw": self.course.loop} if self.course else {}
        loops |= {"depth": self.depth.outer, "pitch": self.depth.inner} if self.depth else {}
        return loops | ({"roll": self.roll.loop} if self.roll else {})

    def _shared(self, asked: Mapping[str, Array]) -> dict[str, Array]:
        """Deflections of the fins for deflections of the axes: right e + a, left e - a."""
        fins = {"rudder": asked["yaw"]} if "yaw" in asked else {}
        for name in self.depth.fins if self.depth else ():
            roll = asked.get("roll", 0.0)
            fins[name] = asked["pitch"] + (roll if name == PAIR[0] else -roll)
        return fins

    def _achieved(self, done: Mapping[str, Array]) -> dict[str, Array]:
        """Deflections of the axes for those of the fins."""
        axes = {"yaw": done["rudder"]} if "rudder" in done else {}
        if self.depth is not None:
            ends = [done[name] for name in self.depth.fins]
            axes |= {"pitch": 0.5 * (ends[0] + ends[-1]), "roll": 0.5 * (ends[0] - ends[-1])}
        return axes
