"""What a user writes: the equations of a model in a dozen lines."""

import abc
import dataclasses
from collections.abc import Mapping
from typing import Any, ClassVar

import equinox as eqx

from ...effects import Signal


class Model(eqx.Module):
    r"""Equations $\dot x = f(x, u, t)$ of a user's own, which then has fits, filters, diagnosis and all else.

    A subclass names its `states` and `inputs`, and defines `rates`. Its fields are the model's numbers, any consistent
    units; a field that is static, `eqx.field(static=True)`, is none.

    **Fields**

    - `states`, `inputs`: their names. An input is also the name of its column of a recording, held between samples.
    - `outputs`: the noise of each measured channel, 1-σ, or `"estimate"`, or what `[outputs.NAME]` of a vehicle file
      says. A channel is a state or one of `shown`.
    - `parameters`: by number what a vehicle file says beside its value, such as `{"bounds": [0, 1], "fixed": True}`;
      numbers are free where it does not say.
    """

    states: ClassVar[tuple[str, ...]]
    inputs: ClassVar[tuple[str, ...]] = ()
    outputs: ClassVar[Mapping[str, Any]] = {}
    parameters: ClassVar[Mapping[str, Mapping[str, Any]]] = {}

    @abc.abstractmethod
    def rates(self, state: Mapping[str, Signal], inputs: Mapping[str, Signal], time: Signal | float) -> dict[str, Any]:
        """The rate of each state, per second, by name, for `state` and `inputs` by name and the run's `time` in s.

        They are arrays of JAX or NumPy with any leading axes.
        """

    def shown(self, state: Mapping[str, Signal], inputs: Mapping[str, Signal], time: Signal | float) -> dict[str, Any]:
        """What sensors may show beside the states, by name, for `state`, `inputs` and `time` as of `rates`."""
        return {}


def numbers_of(kind: type[Model]) -> list[dataclasses.Field]:
    """The fields of a model that are numbers."""
    return [field for field in dataclasses.fields(kind) if not field.metadata.get("static", False)]
