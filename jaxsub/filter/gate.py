"""Innovation gates: which measurements a filter believes."""

import abc
import math
from statistics import NormalDist

import equinox as eqx
import jax.numpy as jnp
from jax.typing import DTypeLike
from jaxtyping import Array, Bool, Float


class AbstractGate(eqx.Module):
    """Decides channel by channel, from how far a measurement lies from what was expected.

    A filter that is wrong itself would reject the truth for ever. A channel whose measurements were outside too often
    in a row, and agreed with each other, is believed until it is inside again; with the first of them the state becomes
    as uncertain as at the start. Wild measurements do not agree, and are rejected however many they are.

    **Fields**

    - `patience`: how many measurements in a row a channel may be outside, each inside the gate about the one before,
      until it is believed.
    """

    patience: eqx.AbstractVar[int]

    @abc.abstractmethod
    def inside(self, innovation: Float[Array, " c"], deviations: Float[Array, " c"]) -> Bool[Array, " c"]:
        """Which channels are as expected; `deviations` are the innovation's standard deviations."""


class Open(AbstractGate):
    """Believes everything."""

    patience: int = eqx.field(static=True, default=0)

    def inside(self, innovation: Float[Array, " c"], deviations: Float[Array, " c"]) -> Bool[Array, " c"]:
        """All channels."""
        return jnp.ones(innovation.shape, bool)


class InnovationGate(AbstractGate):
    r"""Refuses what lies further than so many standard deviations from what was expected.

    That is the test of $\nu_i^2/S_{ii}$ against the chi-square distribution of one degree of freedom.

    **Fields**

    - `widths`: (c,) standard deviations; infinite for a channel that is always believed.
    """

    widths: Float[Array, " c"]
    patience: int = eqx.field(static=True)

    @classmethod
    def of(
        cls, channels: int, false_rejection: float = 1e-6, patience: int = 5, dtype: DTypeLike | None = None
    ) -> "InnovationGate":
        """The gate of so many `channels` that rejects a measurement of a consistent filter with `false_rejection`.

        That probability is by default that of 4.9 standard deviations: at ten measurements a second, one in a day of
        each channel. `patience` is as the field, and `dtype` that of the filter's numbers, by default JAX's own.
        """
        width = NormalDist().inv_cdf(1.0 - 0.5 * false_rejection) if false_rejection > 0.0 else math.inf
        return cls(widths=jnp.full(channels, width, dtype), patience=patience)

    def inside(self, innovation: Float[Array, " c"], deviations: Float[Array, " c"]) -> Bool[Array, " c"]:
        """Those within so many deviations."""
        return jnp.abs(innovation) <= self.widths * deviations
