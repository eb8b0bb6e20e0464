"""Innovation gates: which measurements a filter believes."""

import abc

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float


class AbstractGate(eqx.Module):
    """Decides channel by channel, from how far a measurement lies from what was expected.

    A filter that is wrong itself would refuse the truth for ever: a channel that was outside too often in a row is
    believed, until it is inside again.

    **Fields**

    - `patience`: how many measurements in a row a channel may be outside before it is believed.
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
    """Refuses what lies further than so many standard deviations from what was expected.

    **Fields**

    - `widths`: (c,) standard deviations; infinite for a channel that is always believed.
    """

    widths: Float[Array, " c"]
    patience: int = eqx.field(static=True)

    def inside(self, innovation: Float[Array, " c"], deviations: Float[Array, " c"]) -> Bool[Array, " c"]:
        """Those within so many deviations."""
        return jnp.abs(innovation) <= self.widths * deviations
