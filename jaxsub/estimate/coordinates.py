"""The coordinates of a search: free parameters and initial states as one vector, with their priors and bounds."""

import math
from collections.abc import Callable, Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from ..likelihood.sensitivity import value_and_columns
from ..parameters import Parameter, Transform
from ..programs import compiled
from .curvature import Arrow


class Coordinates(eqx.Module):
    """p free parameters and the initial states (s,) of R runs as one vector y (d,).

    Nothing in it depends on what the parameters are of: programs that take no more serve every vehicle with as many.

    **Fields**

    - `transform`: of the free parameters; `origin`: (p,) the coordinates where they start.
    - `moving`: (p,) false for a coordinate that stays where it starts.
    - `prior_mean`, `prior_std`: (p,) of the parameters, SI; the latter infinite where there is none.
    - `guess`: (R, s) and `start_std`: (s,) Gaussian prior of the initial states, SI; of a known one it is zero.
    - `known_start`: whether initial states are known, and no coordinates. `bounded`: whether a parameter has a bound.
    """

    transform: Transform
    origin: Float[Array, " p"]
    moving: Bool[Array, " p"]
    prior_mean: Float[Array, " p"]
    prior_std: Float[Array, " p"]
    guess: Float[Array, "r s"]
    start_std: Float[Array, " s"]
    known_start: bool = eqx.field(static=True)
    bounded: bool = eqx.field(static=True)

    def theta(self, y: Float[Array, " d"]) -> Float[Array, " p"]:
        """The physical parameters at `y`."""
        return self.transform.to_physical(jnp.where(self.moving, y[: len(self.prior_mean)], self.origin))

    @compiled
    def physical(self, y: Float[Array, " d"]) -> tuple[Float[Array, " p"], Float[Array, "r s"], Float[Array, " q"]]:
        """Parameters and initial states at `y`; the errors' columns by it in those of outputs by physical values."""
        p = len(self.prior_mean)
        _, slope = jax.jvp(self.transform.to_physical, (y[:p],), (jnp.ones(p, y.dtype),))
        scale = jnp.concatenate([-jnp.where(self.moving, slope, 0.0), -jnp.ones_like(self.start_std), jnp.ones(1)])
        return self.theta(y), self.initial_states(y), scale

    def initial_states(self, y: Float[Array, " d"]) -> Float[Array, "r s"]:
        """The initial states at `y`, SI."""
        return self.guess + self.start_std * self.moved(y)

    def moved(self, y: Float[Array, " d"]) -> Float[Array, "r s"]:
        """How far the initial states at `y` are from their guess, in their spreads."""
        states = y[len(self.prior_mean) :]
        return jnp.zeros_like(self.guess) if self.known_start else states.reshape(self.guess.shape)

    def coordinates(self) -> Float[Array, " d"]:
        """The coordinates of the start."""
        return jnp.pad(self.origin, (0, 0 if self.known_start else self.guess.size))

    def at(self, theta: Float[Array, " p"]) -> Float[Array, " d"]:
        """The coordinates of the physical parameters `theta` and the guessed initial states."""
        return self.coordinates().at[: len(theta)].set(self.transform.to_free(theta))

    def bounds(self) -> Callable[[Array, Array], tuple[Array, Array]] | None:
        """`along`, if any free number has a bound."""
        return self.along if self.bounded else None

    def along(self, y: Float[Array, " d"], step: Float[Array, " d"]) -> tuple[Float[Array, " d"], Float[Array, " d"]]:
        """Where a `step` of the values leads from the coordinates `y`, and how much of it, as bounds allow."""
        p = len(self.prior_mean)
        theta, part = self.transform.stepped(y[:p], step[:p])
        return jnp.concatenate([theta, y[p:] + step[p:]]), jnp.concatenate([part, step[p:]])

    def prior(self, y: Float[Array, " d"]) -> Float[Array, " d"]:
        """The residuals of the priors at the coordinates `y` (d,)."""
        p = len(self.prior_mean)
        theta = self.transform.to_physical(y[:p])
        return jnp.concatenate([(theta - self.prior_mean) / self.prior_std, y[p:]])

    def expansion(self, y: Float[Array, " d"], gram: Float[Array, "r q q"]) -> "Expansion":
        """The cost about `y` to second order, its curvature by Gauss and Newton: $J^TJ$.

        `gram` (R, q, q) has the products of each run's whitened columns at `y`: by the parameters, by its own initial
        state, and the error.
        """
        p, s = len(self.prior_mean), 0 if self.known_start else len(self.start_std)
        prior, slopes = value_and_columns(lambda theta: self.prior(y.at[:p].set(theta))[:p], y[:p])
        among = jnp.sum(gram[:, :p, :p], axis=0) + slopes.T @ slopes
        curvature = Arrow(among, gram[:, :p, p:-1], gram[:, p:-1, p:-1] + jnp.eye(s)) if s else among
        by_theta = jnp.sum(gram[:, :p, -1], axis=0) + slopes.T @ prior
        by_start = gram[:, p:-1, -1].ravel() + y[p:]
        cost = 0.5 * (jnp.sum(gram[:, -1, -1]) + jnp.sum(prior**2) + jnp.sum(y[p:] ** 2))
        return Expansion(cost, jnp.concatenate([by_theta, by_start]), curvature)


def has_bounds(parameters: Sequence[Parameter]) -> bool:
    """Whether any of the parameters has a bound."""
    return any(math.isfinite(row.lower) or math.isfinite(row.upper) for row in parameters)


class Expansion(eqx.Module):
    """A cost to second order about a point, in the coordinates of a problem.

    **Fields**

    - `cost`: ½ Σ whitened residuals². `gradient`: (d,) by the coordinates.
    - `curvature`: (d, d) by the coordinates, or the parts of that.
    """

    cost: Float[Array, ""]
    gradient: Float[Array, " d"]
    curvature: Arrow | Float[Array, "d d"]

    @property
    def hessian(self) -> Float[Array, "d d"]:
        """The curvature with all of its zeros."""
        return self.curvature.dense() if isinstance(self.curvature, Arrow) else self.curvature
