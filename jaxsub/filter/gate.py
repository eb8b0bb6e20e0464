"""Innovation gates: which measurements a filter believes."""

import abc

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int


class AbstractGate(eqx.Module):
    """Decides channel by channel, from how far a measurement lies from what was expected."""

    @abc.abstractmethod
    def __call__(
        self, refused: Int[Array, " c"], innovation: Float[Array, " c"], deviations: Float[Array, " c"]
    ) -> Bool[Array, " c"]:
        """Which channels are believed.

        `refused` counts how often each was refused in a row, `deviations` are the innovation's standard deviations.
        """


class Open(AbstractGate):
    """Believes everything."""

    def __call__(
        self, refused: Int[Array, " c"], innovation: Float[Array, " c"], deviations: Float[Array, " c"]
    ) -> Bool[Array, " c"]:
        """All channels."""
        return jnp.ones(innovation.shape, bool)


class InnovationGate(AbstractGate):
    """Refuses what lies further than so many standard deviations from what was expected.

    A filter that is wrong itself would refuse the truth for ever: a channel refused too often in a row is believed.

    **Fields**

    - `widths`: (c,) standard deviations; infinite for a channel that is always believed.
    - `patience`: how many measurements in a row a channel may be refused.
    """

    widths: Float[Array, " c"]
    patience: int = eqx.field(static=True)

    def __call__(
        self, refused: Int[Array, " c"], innovation: Float[Array, " c"], deviations: Float[Array, " c"]
    ) -> Bool[Array, " c"]:
        """Those within the gate, and those that have been outside too long."""
        return (jnp.abs(innovation) <= self.widths * deviations) | (refused >= self.patience)
