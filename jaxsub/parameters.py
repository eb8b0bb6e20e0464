"""Which leaves of a model are free, within which bounds, under which prior.

A vehicle keeps its numbers in flat dictionaries keyed by name; beside them stands a static table of
`Parameter` rows that says what an estimator may do with each. Estimators see only the free vector of
*unconstrained* coordinates that `Transform` makes of it.
"""

import dataclasses
import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Float

from .programs import compiled

# of the way to a bound, the most that a step goes
_PART = 0.9


def number(value: ArrayLike) -> Array:
    """`value` as an array of the float type in force.

    Python numbers would become weakly typed arrays, and a model that holds one is compiled for again once it is fitted.
    """
    # by NumPy, since JAX compiles a program to convert a Python number
    return jnp.asarray(np.asarray(value, jnp.result_type(float)) if isinstance(value, float | int) else value)


@dataclasses.dataclass(frozen=True)
class Parameter:
    """One named number of a model.

    **Fields**

    - `name`: ASCII SNAME for coefficients, `effect[where].symbol` for an effect's parameter.
    - `unit`: SI unit as text, empty where the file gives none.
    - `free`: whether an estimator may move it.
    - `lower`, `upper`: bounds in SI, infinite where there are none.
    - `prior_std`: standard deviation of a Gaussian prior about `prior_mean`, infinite where there is none.
    - `prior_mean`: the value that the vehicle file gives.
    - `varies`: whether it differs by run about a common mean, which bounds and prior are then for.
    - `spread`: standard deviation between runs where a file gives it; a vehicle has it among its `spreads`.
    """

    name: str
    unit: str = ""
    free: bool = True
    lower: float = -math.inf
    upper: float = math.inf
    prior_std: float = math.inf
    prior_mean: float = 0.0
    varies: bool = False
    spread: float = 0.0


class Transform(eqx.Module):
    r"""The bijection between physical values $\theta$ and the estimator's coordinates $y$.

    Without bounds $\theta = \theta_0 + s\,y$; with one bound $\theta = lo + s\,\mathrm{softplus}(y)$ (mirrored for an
    upper one); with two $\theta = lo + (hi - lo)\,\mathrm{sigmoid}(y)$. $s$ is each coefficient's own size, so that a
    step of one unit means as much for an added mass of 4000 kg as for a time constant of 0.1 s.
    """

    lower: Float[Array, " p"]
    upper: Float[Array, " p"]
    centre: Float[Array, " p"]
    scale: Float[Array, " p"]

    @classmethod
    def of(cls, parameters: list[Parameter], start: np.ndarray) -> "Transform":
        """The transform for `parameters` about the values `start` (p,); a zero start has unit scale."""
        start = np.asarray(start, float)
        lower, upper = (np.array([getattr(p, side) for p in parameters], float) for side in ("lower", "upper"))
        scale = np.where(start == 0.0, 1.0, np.abs(start))
        return cls(*jax.device_put((lower, upper, start, scale)))

    def to_physical(self, y: Float[Array, " p"]) -> Float[Array, " p"]:
        """Physical values of the coordinates `y`."""
        low, lower, upper = self._bounds()
        soft = self.scale * _softplus(y)
        both = lower + (upper - lower) / (1.0 + jnp.exp(-y))
        one = jnp.where(low, lower + soft, upper - soft)
        return self._as_bounded(both, one, self.centre + self.scale * y)

    @compiled
    def to_free(self, theta: Float[Array, " p"]) -> Float[Array, " p"]:
        """Coordinates of the physical values `theta`, which are first moved just inside their bounds."""
        low, lower, upper = self._bounds()
        width = self._as_bounded(upper - lower, 1.0, 1.0)
        fraction = jnp.clip((theta - lower) / width, 1e-3, 1.0 - 1e-3)
        gap = jnp.maximum(jnp.where(low, theta - lower, upper - theta) / self.scale, 1e-3)
        both = jnp.log(fraction) - jnp.log1p(-fraction)
        return self._as_bounded(both, _of_softplus(gap), (theta - self.centre) / self.scale)

    def stepped(self, y: Float[Array, " p"], step: Float[Array, " p"]) -> tuple[Float[Array, " p"], Float[Array, " p"]]:
        r"""Coordinates of $\theta + \dot\theta(y)\,\mathrm{step}$, and how much of `step` leads there.

        Less than all of it where it would go further than nine tenths of the way to a bound. Close to one a coordinate
        has to go far for the little that is left of its value, and a value goes far in a short step of it.
        """
        # so close to a bound that nothing is left to go there is no slope
        rising, left = (jnp.maximum(jax.nn.sigmoid(side), jnp.finfo(y.dtype).tiny) for side in (y, -y))
        gap = _softplus(y)
        between = jnp.clip(step, -_PART / left, _PART / rising)
        above = jnp.maximum(step, -_PART * gap / rising)
        both = y + jnp.log1p(left * between) - jnp.log1p(-rising * between)
        one = _of_softplus(gap + rising * above)
        return self._as_bounded(both, one, y + step), self._as_bounded(between, above, step)

    def _bounds(self) -> tuple[Bool[Array, " p"], Float[Array, " p"], Float[Array, " p"]]:
        """Which have a lower bound, and the bounds, 0 where there is none."""
        low, high = jnp.isfinite(self.lower), jnp.isfinite(self.upper)
        return low, jnp.where(low, self.lower, 0.0), jnp.where(high, self.upper, 0.0)

    def _as_bounded(self, both: ArrayLike, one: ArrayLike, none: ArrayLike) -> Float[Array, " p"]:
        """What goes for those with two bounds, with one and with none."""
        low, high = jnp.isfinite(self.lower), jnp.isfinite(self.upper)
        return jnp.where(low & high, both, jnp.where(low | high, one, none))


def _softplus(y: Array) -> Array:
    # by |y| it would have no slope at zero
    above, below = jnp.maximum(y, 0.0), jnp.minimum(y, 0.0)
    return above + jnp.log1p(jnp.exp(below - above))


def _of_softplus(value: Array) -> Array:
    """What the softplus of is `value`."""
    return value + jnp.log(-jnp.expm1(-value))
