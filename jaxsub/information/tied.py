"""What a fit says of numbers that follow from its coefficients by expressions of the vehicle file."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..estimate import Solution
from ..vehicle.ties import Tie, followed


@dataclasses.dataclass(frozen=True)
class TiedNumber:
    """A number that follows from free coefficients.

    **Fields**

    - `name`, `value`, `unit`: SI. `ends`: the free coefficients that it follows.
    - `slope`: (p,) its derivative by each of the fit's coefficients.
    """

    name: str
    value: float
    unit: str
    ends: tuple[str, ...]
    slope: Float[np.ndarray, " p"]

    def error(self, covariance: Float[np.ndarray, "p p"]) -> float:
        r"""$\sqrt{g^TCg}$ with the `covariance` C of the coefficients."""
        return float(np.sqrt(self.slope @ covariance @ self.slope))


def tied_numbers(fit: Solution) -> tuple[TiedNumber, ...]:
    """The numbers that follow from coefficients of `fit`, in the order of the vehicle file."""
    ties, ends = fit.vehicle.layout.ties, followed(fit.vehicle.layout.ties)
    own = {tie.name: tuple(name for name in ends[tie.name] if name in fit.names) for tie in ties}
    ties = tuple(tie for tie in ties if own[tie.name])
    if not ties:
        return ()
    values = {name: jnp.asarray(value) for name, value in fit.values.items()}
    shown = _shown(fit, ties, values)
    slopes = jax.jacfwd(lambda changed: _shown(fit, ties, changed))(values)
    columns = np.stack([np.asarray(slopes[name]) for name in fit.names], axis=-1)
    return tuple(
        TiedNumber(tie.name, float(value), tie.unit, own[tie.name], column)
        for tie, value, column in zip(ties, shown, columns, strict=True)
    )


def _shown(fit: Solution, ties: tuple[Tie, ...], values: dict[str, Array]) -> Float[Array, " t"]:
    """The tied numbers for `values` of the coefficients."""
    moved, names = fit.vehicle.with_values(values), fit.vehicle.aliases
    found = moved.values()
    return jnp.stack([jnp.asarray(found[names.get(tie.name, tie.name)]) for tie in ties])
