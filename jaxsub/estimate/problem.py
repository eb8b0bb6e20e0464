"""A fit as a least-squares problem in unbounded, scaled coordinates."""

import dataclasses
import math
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Bool, Float

from ..arrays import quietly
from ..errors import InputError
from ..likelihood import errors
from ..likelihood.blocks import Watch, nobody, summed_products
from ..likelihood.march import March
from ..likelihood.sensitivity import value_and_columns
from ..parameters import Transform
from ..programs import compiled
from ..recording.runs import Runs
from ..vehicle import AbstractVehicle
from .coordinates import Coordinates, Expansion, has_bounds
from .initial_states import initial_guess
from .newton_raphson import second_order

# how far from the origin two points show which numbers the parameters move
_NEAR = 0.1


class Problem(Coordinates):
    """Free parameters and initial states of R runs as one vector, and its whitened residuals.

    **Fields** beside those of `Coordinates`

    - `vehicle`: its free numbers are where the search starts. `runs`: the recordings.
    - `sigma`: (c,) noise of each channel, SI.
    - `march`: where there is one, cost and expansion come from compiled C, and have no further derivatives.
    """

    vehicle: AbstractVehicle
    runs: Runs
    sigma: Float[Array, " c"]
    march: March | None = eqx.field(static=True, default=None)

    @classmethod
    def of(
        cls,
        vehicle: AbstractVehicle,
        runs: Runs,
        sigma: Array,
        start: Array | None = None,
        *,
        moving: bool | Bool[Array, " p"] = True,
        known_start: bool = False,
    ) -> "Problem":
        """The problem of fitting `vehicle` to `runs`.

        The search starts from the initial states `start` (R, s), SI, if given; `sigma` (c,) is the noise of the
        channels, SI. Parameters that are not moving stay: false frees the initial states alone. That is data and not
        structure, so one compiled search serves every choice. With known_start, `start` is the truth.
        """
        rows = vehicle.layout.free
        values = vehicle.values()
        theta = np.array([float(values[row.name]) for row in rows], float)
        own = vehicle.own_values()
        # an effect without a prior starts at its fitted or predicted size, which is no prior knowledge
        known = lambda row: row.name in own or math.isfinite(row.prior_std)
        means = [row.prior_mean if known(row) else float(values[row.name]) for row in rows]
        guess, start_std = initial_guess(vehicle, runs)
        transform = Transform.of(rows, theta)
        # `jnp.asarray` would make a program of every shape
        arrays: dict[str, Any] = jax.device_put(
            {
                "moving": np.broadcast_to(np.asarray(moving), (len(rows),)),
                "prior_mean": np.array(means, float),
                "prior_std": np.array([row.prior_std for row in rows], float),
                "start_std": np.zeros(len(start_std)) if known_start else start_std,
            }
        )
        return cls(
            vehicle=vehicle,
            runs=runs,
            sigma=jnp.asarray(sigma),
            transform=transform,
            origin=transform.to_free(transform.centre),
            guess=guess if start is None else start,
            known_start=known_start,
            bounded=has_bounds(rows),
            **arrays,
        )

    @property
    def values(self) -> Float[Array, " p"]:
        """The vehicle's free numbers, SI."""
        values = self.vehicle.values()
        return jax.device_put(np.array([float(values[row.name]) for row in self.vehicle.layout.free]))

    @property
    def without_vehicle(self) -> Coordinates:
        """The coordinates alone."""
        return Coordinates(**{field.name: getattr(self, field.name) for field in dataclasses.fields(Coordinates)})

    def in_c(self) -> "Problem":
        """The same problem on compiled C: for many searches, or one that is waited for.

        **Raises** `InputError` as `March` does.
        """
        rng = np.random.default_rng(0)
        free = dataclasses.replace(self, moving=jnp.ones_like(self.moving))
        near = lambda: self.origin + jnp.asarray(_NEAR * rng.standard_normal(len(self.origin)))
        march = March(free.vehicle_at, (near(), near()), self.runs, start=not self.known_start)
        return dataclasses.replace(self, march=march)

    def split(self, y: Float[Array, " d"]) -> tuple[AbstractVehicle, Float[Array, "r s"]]:
        """The vehicle and the initial states that the coordinates `y` stand for."""
        theta, start, _ = self.without_vehicle.physical(y)
        return self.vehicle_with(theta), start

    def vehicle_at(self, y: Float[Array, " p"]) -> AbstractVehicle:
        """The vehicle that the coordinates `y` of the parameters stand for."""
        return self.vehicle_with(self.theta(y))

    def vehicle_with(self, estimate: Float[Array, " p"]) -> AbstractVehicle:
        """The vehicle whose free numbers are an `estimate` (p,), SI."""
        # by NumPy: to cut an array of JAX would be a program for each place
        each = estimate if isinstance(estimate, Tracer) else jax.device_put([*np.asarray(estimate)])
        names = [row.name for row in self.vehicle.layout.free]
        return self.vehicle.with_values(dict(zip(names, each, strict=True)))

    def coordinates_of(self, vehicle: AbstractVehicle, start: Float[Array, "r s"]) -> Float[Array, " d"]:
        """The coordinates of the numbers of `vehicle` and the initial states `start`; known ones have none."""
        values = vehicle.values()
        theta = jnp.array([values[row.name] for row in self.vehicle.layout.free])
        if self.known_start:
            return self.at(theta)
        moved = (start - self.guess) / jnp.where(self.start_std > 0.0, self.start_std, 1.0)
        return self.at(theta).at[len(theta) :].set(jnp.where(self.start_std > 0.0, moved, 0.0).ravel())

    def residuals(self, y: Float[Array, " d"]) -> Float[Array, " m"]:
        """Whitened errors of the outputs at the coordinates `y` (d,), then of the priors."""
        return jnp.concatenate([_outputs(self, y, jnp.zeros(len(self.start_std))).ravel(), self.prior(y)])

    def cost(self, y: Float[Array, " d"]) -> Float[Array, ""]:
        r"""$\tfrac12\sum$ residuals² at the coordinates `y` (d,): minus the log-likelihood, up to its constant."""
        if self.march is None:
            return 0.5 * jnp.sum(self.residuals(y) ** 2)
        squares = self.march.squares(
            self.vehicle_at, y[: len(self.prior_mean)], self.initial_states(y), self.runs, self.sigma
        )
        return 0.5 * (jnp.sum(squares) + jnp.sum(self.prior(y) ** 2))

    @compiled
    def expand(self, y: Float[Array, " d"]) -> Expansion:
        """The cost about `y` to second order, its curvature by Gauss and Newton: $J^TJ$."""
        return self.expansion(y, self.products(y))

    def products(self, y: Float[Array, " d"]) -> Float[Array, "r q q"]:
        """Products of each run's whitened columns at `y` (d,): by the parameters, its own initial state, and the error.

        Runs do not feel each other's initial states, so one tangent a state serves every run: p + s simulations instead
        of p + R s.
        """
        p, s = len(self.prior_mean), 0 if self.known_start else len(self.start_std)
        still = jnp.zeros(len(self.start_std))
        if self.march is not None:
            return self.march.products(
                self.vehicle_at, y[:p], self.initial_states(y), self.start_std, self.runs, self.sigma
            )

        def shown(change: Array) -> Array:
            return _outputs(self, y.at[:p].add(change[:p]), still.at[:s].add(change[p:]))

        error, columns = value_and_columns(shown, jnp.zeros(p + s))
        every = jnp.concatenate([columns, error[..., None]], axis=-1)
        return jnp.einsum("rkca,rkcb->rab", every, every)

    @quietly
    def products_in_blocks(self, y: Float[Array, " d"], watch: Watch = nobody) -> Float[Array, "r q q"]:
        """`products` at `y` (d,), summed over blocks of samples. Not to be called in `jit`.

        `watch` is called with the share of the samples that is done.
        """
        theta, start, scale = self.without_vehicle.physical(y)
        # by NumPy, for which no program has to be made
        scale = np.asarray(scale)
        vehicle = self.vehicle_with(theta)
        gram = np.asarray(summed_products(vehicle, self.runs, start, self.sigma, self.start_std, watch))
        p, q = len(self.prior_mean), len(scale)
        kept = np.array([*range(p), q - 1]) if self.known_start else np.arange(q)
        return jax.device_put((scale[:, None] * gram * scale)[:, kept[:, None], kept])

    @compiled
    def expand_exactly(self, y: Float[Array, " d"]) -> Expansion:
        """The cost about `y` to second order, its curvature exact."""
        cost, gradient, hessian, _ = second_order(lambda y, _: (self.cost(y), None), y, None)
        return Expansion(cost, gradient, hessian)


def require_free(vehicle: AbstractVehicle, where: str) -> None:
    """`vehicle`, read from `where`, has a number to fit. **Raises** `InputError` where all are fixed."""
    if not vehicle.layout.free:
        raise InputError(where, "all coefficients are fixed, so there is nothing to fit", "leave at least one free")


@compiled
def _outputs(problem: Problem, y: Array, moved: Array) -> Float[Array, "r k c"]:
    """Whitened errors at `y`, the initial states of all runs moved by the same `moved` (in their spreads)."""
    vehicle, start = problem.split(y)
    return errors(vehicle, problem.runs, start + problem.start_std * moved) / problem.sigma
