"""A fit as a least-squares problem in unbounded, scaled coordinates."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from ..effects import CHANNEL_UNITS, VELOCITIES
from ..likelihood import errors
from ..parameters import Transform
from ..recording.runs import Runs
from ..vehicle import AbstractVehicle

# how far an initial state that nothing measures may lie from rest: m/s, rad/s, rad, m
_SPREAD = {"m/s": 1.0, "rad/s": 0.5, "rad": 0.5, "m": 10.0}


class Problem(eqx.Module):
    """Free parameters and initial states of R runs as one vector, and its whitened residuals.

    **Fields**

    - `vehicle`: its free numbers are where the search starts. `runs`: the recordings.
    - `sigma`: (c,) noise of each channel, SI.
    - `transform`: of the free parameters; `origin`: (p,) the coordinates where they start, and stay where `moving` is
      false. `prior_mean`, `prior_std`: (p,), the latter infinite where there is none.
    - `guess`, `spread`: (R, s) and (s,) Gaussian prior of the initial states.
    """

    vehicle: AbstractVehicle
    runs: Runs
    sigma: Float[Array, " c"]
    transform: Transform
    origin: Float[Array, " p"]
    moving: Bool[Array, ""]
    prior_mean: Float[Array, " p"]
    prior_std: Float[Array, " p"]
    guess: Float[Array, "r s"]
    spread: Float[Array, " s"]

    @classmethod
    def of(
        cls, vehicle: AbstractVehicle, runs: Runs, sigma: Array, start: Array | None = None, *, moving: bool = True
    ) -> "Problem":
        """The problem of fitting `vehicle` to `runs`; the search starts from the initial states `start`, if given.

        `moving` false keeps the parameters and frees the initial states alone. It is data and not structure, so the
        same compiled search serves both.
        """
        rows = vehicle.layout.free
        values = vehicle.values()
        theta = np.array([float(values[row.name]) for row in rows])
        own = vehicle.own_values()
        # an effect starts at its fitted or predicted size, which is no prior knowledge
        means = [row.prior_mean if row.name in own else float(values[row.name]) for row in rows]
        guess, spread = initial_guess(vehicle, runs)
        transform = Transform.of(rows, theta)
        return cls(
            vehicle,
            runs,
            jnp.asarray(sigma),
            transform,
            transform.to_free(jnp.asarray(theta)),
            jnp.asarray(moving),
            jnp.asarray(means),
            jnp.asarray([row.prior_std for row in rows]),
            guess if start is None else start,
            spread,
        )

    def split(self, y: Float[Array, " d"]) -> tuple[AbstractVehicle, Float[Array, "r s"]]:
        """The vehicle and the initial states that the coordinates `y` stand for."""
        p = len(self.prior_mean)
        names = [row.name for row in self.vehicle.layout.free]
        theta = self.transform.to_physical(jnp.where(self.moving, y[:p], self.origin))
        vehicle = self.vehicle.with_values(dict(zip(names, theta, strict=True)))
        return vehicle, self.guess + self.spread * y[p:].reshape(self.guess.shape)

    def coordinates(self) -> Float[Array, " d"]:
        """The coordinates of the start."""
        return jnp.concatenate([self.origin, jnp.zeros(self.guess.size)])

    def residuals(self, y: Float[Array, " d"]) -> Float[Array, " m"]:
        """Whitened errors of the outputs, then of the priors."""
        return _residuals(y, problem=self)


@eqx.filter_custom_jvp
def _residuals(y: Array, *, problem: Problem) -> Array:
    output = _outputs(problem, y, jnp.zeros(len(problem.spread)))
    return jnp.concatenate([output.ravel(), _prior(problem, y)])


@_residuals.def_jvp
def _residuals_jvp(primals: tuple[Array], tangents: tuple[Array], *, problem: Problem) -> tuple[Array, Array]:
    """All columns of the Jacobian at once, whatever the tangent.

    Runs do not feel each other's initial states, so one tangent a state serves every run: p + s simulations instead of
    p + R s. A solver that asks for many tangents in a `vmap` shares them, and the model is compiled into it once.
    """
    (y,), (dy,) = primals, tangents
    p, s = len(problem.prior_mean), len(problem.spread)
    at_parameters = lambda theta, moved: _outputs(problem, jnp.concatenate([theta, y[p:]]), moved)
    by_theta, by_state = jax.jacfwd(at_parameters, argnums=(0, 1))(y[:p], jnp.zeros(s))
    along = by_theta @ dy[:p] + jnp.einsum("rkcs,rs->rkc", by_state, dy[p:].reshape(problem.guess.shape))
    prior, prior_along = jax.jvp(lambda y: _prior(problem, y), (y,), (dy,))
    value = jnp.concatenate([_outputs(problem, y, jnp.zeros(s)).ravel(), prior])
    return value, jnp.concatenate([along.ravel(), prior_along])


@eqx.filter_jit
def _outputs(problem: Problem, y: Array, moved: Array) -> Float[Array, "r k c"]:
    """Whitened errors at `y`, the initial states of all runs moved by the same `moved` (in their spreads)."""
    vehicle, start = problem.split(y)
    return errors(vehicle, problem.runs, start + problem.spread * moved) / problem.sigma


def _prior(problem: Problem, y: Array) -> Float[Array, " d"]:
    p = len(problem.prior_mean)
    theta = problem.transform.to_physical(y[:p])
    return jnp.concatenate([(theta - problem.prior_mean) / problem.prior_std, y[p:]])


def initial_guess(vehicle: AbstractVehicle, runs: Runs) -> tuple[Float[Array, "r s"], Float[Array, " s"]]:
    """Initial states from the first measured sample of each state's channel, else rest at the operating speed."""
    layout = vehicle.layout
    body = layout.kind == "submerged-body"
    names = [VELOCITIES[e] if body else f"{e}_rate" for e in layout.equations] + list(layout.positions)
    aliases = {"z": ("z", "depth")}
    mask, outputs = np.asarray(runs.mask), np.asarray(runs.outputs)
    guess = np.zeros((runs.times.shape[0], len(names)))
    spread = np.ones(len(names))
    for i, name in enumerate(names):
        spread[i] = _SPREAD.get(CHANNEL_UNITS.get(name, ""), 1.0)
        channel = next((c for c in aliases.get(name, (name,)) if c in layout.channels), None)
        if channel is None:
            guess[:, i] = float(vehicle.own_values()["speed"]) if body and name == "u" else 0.0
            continue
        column = layout.channels.index(channel)
        for run in range(len(guess)):
            seen = np.flatnonzero(mask[run, :, column])
            guess[run, i] = outputs[run, seen[0], column] if len(seen) else 0.0
        # wide enough that the prior weighs nothing against the channel's own first samples
        spread[i] = max(spread[i], _std(outputs[..., column][mask[..., column]]))
    return jnp.asarray(guess), jnp.asarray(spread)


def _std(samples: np.ndarray) -> float:
    return float(np.std(samples)) if len(samples) else 0.0
