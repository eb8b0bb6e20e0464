"""Sensor effects that are not linear in the output: late, cut off, or without its sign."""

import math
from collections.abc import Mapping, Sequence
from typing import ClassVar

import equinox as eqx
from jaxtyping import Array, Float

from ..arrays import namespace
from ..parameters import number
from .base import AbstractSensor, amplitude, shape
from .motion import Facts, Motion, Signal

# channels that have one sign by nature
_ONE_SIGN = ("speed", "depth", "z", "x", "y", "u", "pressure", "latitude", "longitude")


class SensorDelay(AbstractSensor):
    r"""A late reading: $z(t) = y(t - \tau)$, $\tau \ge 0$ in s, by linear interpolation between the samples.

    Before the run y is taken to be its first sample. Source: Ljung (1999), §4.2.
    """

    name: ClassVar[str] = "sensor-delay"
    family: ClassVar[str] = "sensors"
    remembers: ClassVar[bool] = True
    channel: str = eqx.field(static=True)
    tau: Array = shape("s", sign=+1, default=0.1)

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[SensorDelay]":
        """Each channel with delays from half a sample up."""
        grid = [n * facts.sample_interval for n in (0.5, 1.0, 2.0, 4.0, 8.0)]
        return [cls(channel, number(tau)) for channel in facts.channels for tau in grid]

    @property
    def expression(self) -> str:
        """The delay."""
        return f"{self.channel} measured(t) = {self.channel}(t - τ)"

    @property
    def delay(self) -> Signal | float:
        """None where it would be ahead."""
        return namespace(self.tau).maximum(self.tau, 0.0)

    def measure(
        self, times: Float[Signal, " *k"], outputs: Mapping[str, Signal], motion: Motion
    ) -> Float[Signal, " *k"]:
        """The output a while ago."""
        xp = namespace(times, self.tau)
        late = xp.vectorize(xp.interp, signature="(k),(k),(k)->(k)")
        return late(times - self.delay, times, xp.asarray(outputs[self.channel]))

    def remembered(self, interval: float) -> int:
        """The samples of the delay."""
        return math.ceil(float(self.delay) / interval)

    def undone(self, times: Float[Signal, " *k"], recorded: Float[Signal, " *k"]) -> Float[Signal, " *k"]:
        """What was shown a while later."""
        return namespace(times, recorded, self.tau).interp(times + self.delay, times, recorded)


class SensorSaturation(AbstractSensor):
    r"""A sensor at the end of its range: $z = \min(\max(y, -l), l)$, $l > 0$ in the channel's unit.

    Source: Titterton and Weston (2004), §4.
    """

    name: ClassVar[str] = "sensor-saturation"
    family: ClassVar[str] = "sensors"
    channel: str = eqx.field(static=True)
    limit: Array = shape("1", sign=+1, default=1.0)

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[SensorSaturation]":
        """Each channel with a limit at or a little below the largest that it showed, which noise may exceed."""
        shown = {c: max(map(abs, facts.output_range[c])) for c in facts.channels if c in facts.output_range}
        return [
            cls(c, number(part * size)) for c, size in shown.items() if size > 0.0 for part in (0.8, 0.9, 0.95, 1.0)
        ]

    @property
    def expression(self) -> str:
        """The limit."""
        return f"|{self.channel} measured| <= limit"

    def measure(
        self, times: Float[Signal, " *k"], outputs: Mapping[str, Signal], motion: Motion
    ) -> Float[Signal, " *k"]:
        """The output within the limit."""
        xp = namespace(times, self.limit)
        return xp.clip(xp.asarray(outputs[self.channel]), -self.limit, self.limit)


class SensorRectification(AbstractSensor):
    r"""A sensor that loses the sign: $z = y + f(|y| - y)$, $0 \le f \le 1$; a full rectifier has f = 1.

    Source: Horowitz and Hill (2015), §4.3; the Silverbox's and like rigs' detectors.
    """

    name: ClassVar[str] = "sensor-rectification"
    family: ClassVar[str] = "sensors"
    channel: str = eqx.field(static=True)
    f: Array = amplitude("1", sign=+1)

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[SensorRectification]":
        """Each channel that may be negative: where only a part is lost, some of it still is."""
        return [cls(c) for c, shown in facts.shown.items() if shown not in _ONE_SIGN]

    @property
    def expression(self) -> str:
        """The lost sign."""
        return f"{self.channel} measured = {self.channel} + f (|{self.channel}| - {self.channel})"

    def measure(
        self, times: Float[Signal, " *k"], outputs: Mapping[str, Signal], motion: Motion
    ) -> Float[Signal, " *k"]:
        """The rectified output."""
        true = namespace(times, self.f).asarray(outputs[self.channel])
        return true + self.f * (abs(true) - true)
