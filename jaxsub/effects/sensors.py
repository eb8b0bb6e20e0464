"""Sensor effects: bias, scale and drift of what stands between the truth and its recording."""

from collections.abc import Mapping, Sequence
from typing import ClassVar

import equinox as eqx
from jaxtyping import Array, Float

from ..arrays import namespace
from .base import AbstractSensor, amplitude, of_output
from .motion import Facts, Motion, Signal, quantity_of, read_quantity


class SensorBias(AbstractSensor):
    r"""A constant error: $z = y + b$. Source: Titterton and Weston (2004), §4."""

    name: ClassVar[str] = "sensor-bias"
    family: ClassVar[str] = "sensors"
    of_prescribed: ClassVar[bool] = True
    channel: str = eqx.field(static=True)
    bias: Array = amplitude("1")
    quantity: str = of_output()

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[SensorBias]":
        """One for each channel and each prescribed motion."""
        return [cls(channel, quantity=quantity_of(channel, facts.quantities)) for channel in facts.recorded]

    def units(self) -> dict[str, str]:
        """The channel's own."""
        return {"bias": read_quantity(self.quantity, self.channel)[2]}

    @property
    def term(self) -> str:
        """The offset of the output."""
        return f"{self.channel}.offset"

    @property
    def expression(self) -> str:
        """The bias."""
        return f"{self.channel} measured = {self.channel} + b"

    def measure(
        self, times: Float[Signal, " *k"], outputs: Mapping[str, Signal], motion: Motion
    ) -> Float[Signal, " *k"]:
        """The biased output."""
        return namespace(times, self.bias).asarray(outputs[self.channel] + self.bias)

    def undone(self, times: Float[Signal, " *k"], recorded: Float[Signal, " *k"]) -> Float[Signal, " *k"]:
        """The motion that was `recorded`, without it."""
        return recorded - self.bias


class SensorScale(AbstractSensor):
    r"""A wrong scale: $z = (1 + s)\,y$. Source: Titterton and Weston (2004), §4."""

    name: ClassVar[str] = "sensor-scale"
    family: ClassVar[str] = "sensors"
    of_prescribed: ClassVar[bool] = True
    channel: str = eqx.field(static=True)
    # a sensor that is off by more than what it should show is no sensor of it, but a way out
    scale: Array = amplitude("1", most=1.0)

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[SensorScale]":
        """One for each channel and each prescribed motion."""
        return [cls(channel) for channel in facts.recorded]

    @property
    def term(self) -> str:
        """The scale of the output."""
        return f"{self.channel}.scale"

    @property
    def expression(self) -> str:
        """The scale."""
        return f"{self.channel} measured = (1 + s) {self.channel}"

    def measure(
        self, times: Float[Signal, " *k"], outputs: Mapping[str, Signal], motion: Motion
    ) -> Float[Signal, " *k"]:
        """The scaled output."""
        return namespace(times, self.scale).asarray((1.0 + self.scale) * outputs[self.channel])

    def undone(self, times: Float[Signal, " *k"], recorded: Float[Signal, " *k"]) -> Float[Signal, " *k"]:
        """The motion that was `recorded`, without it."""
        return recorded / (1.0 + self.scale)


class SensorDrift(AbstractSensor):
    r"""An error that grows with the time of the run: $z = y + d\,t$. Source: Titterton and Weston (2004), §4."""

    name: ClassVar[str] = "sensor-drift"
    family: ClassVar[str] = "sensors"
    of_prescribed: ClassVar[bool] = True
    channel: str = eqx.field(static=True)
    drift: Array = amplitude("1/s")
    quantity: str = of_output()

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[SensorDrift]":
        """One for each channel and each prescribed motion."""
        return [cls(channel, quantity=quantity_of(channel, facts.quantities)) for channel in facts.recorded]

    def units(self) -> dict[str, str]:
        """The channel's own, per second."""
        return {"drift": f"{read_quantity(self.quantity, self.channel)[2]}/s"}

    @property
    def expression(self) -> str:
        """The drift."""
        return f"{self.channel} measured = {self.channel} + d t"

    def measure(
        self, times: Float[Signal, " *k"], outputs: Mapping[str, Signal], motion: Motion
    ) -> Float[Signal, " *k"]:
        """The drifting output."""
        return namespace(times, self.drift).asarray(outputs[self.channel] + self.drift * times)

    def undone(self, times: Float[Signal, " *k"], recorded: Float[Signal, " *k"]) -> Float[Signal, " *k"]:
        """The motion that was `recorded`, without it."""
        return recorded - self.drift * times
