r"""The whole posterior of a fit, drawn by NumPyro's no-U-turn sampler, as ArviZ holds it.

$p(\theta, x_0, \sigma \mid Z) \propto e^{-J}\,\prod_c \sigma_c^{-N_c - 1}\,\left|\partial\theta/\partial y\right|$ with
the cost J that every other estimator minimises (`Problem.cost`). Coefficients have a flat prior within their bounds, or
the Gaussian one that the vehicle file gives; initial states have `Problem`'s; a noise that is to be estimated has
Jeffreys's $1/\sigma$. The chains run in the estimator's coordinates y, where bounds are at infinity, and the Jacobian
makes the prior flat in what the coefficients are.

Source: Hoffman and Gelman (2014), J. Machine Learning Research 15.
"""

import dataclasses
import warnings
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Key, PRNGKeyArray

from ..errors import InputError, optional
from ..programs import compiled
from .fitting import Solution
from .problem import Problem

# how far apart the chains start, in standard errors, so that their agreement says something
_APART = 1.5
# an eigenvalue of the information matrix, of unit diagonal, below which no recording speaks
_SILENT = 1e-10


class Target(eqx.Module):
    """Minus the log-density of (y, log σ of the channels whose noise is estimated), up to a constant.

    `problem` is the fit's, `mode` (d,) where the fit ended and `covariance` (d, d) the Gauss–Newton one there;
    `estimated` (c,) says whose noise is to be estimated.
    """

    problem: Problem
    mode: Float[Array, " d"]
    covariance: Float[Array, "d d"]
    estimated: tuple[bool, ...] = eqx.field(static=True)

    @classmethod
    def of(cls, found: Solution) -> "Target":
        """Of what `found` fitted. Raises InputError where the recordings leave a direction open."""
        problem = found.problem
        estimated = tuple(output.sigma is None for output in found.vehicle.layout.outputs)
        moved = (found.start - problem.guess) / jnp.where(problem.start_std > 0.0, problem.start_std, 1.0)
        states = jnp.zeros(0) if found.known_start else moved.ravel()
        y = jnp.concatenate([problem.origin, states])
        information = _information(found, problem, estimated)
        size = jnp.sqrt(jnp.diag(information))
        scaled = information / jnp.outer(size, size)
        if not float(jnp.linalg.eigvalsh(scaled)[0]) > _SILENT:
            what = "the recordings leave a combination of coefficients open, and a flat prior on it is none"
            raise InputError(found.vehicle.layout.name, what, "fix one of them or give it a prior_std")
        mode = jnp.concatenate([y, jnp.log(found.sigma)[np.flatnonzero(estimated)]])
        return cls(problem, mode, jnp.linalg.inv(scaled) / jnp.outer(size, size), estimated)

    def __call__(self, at: Float[Array, " d"]) -> Float[Array, ""]:
        """Infinite where the model does not run."""
        y, sigma = self.split(at)
        p = len(self.problem.prior_mean)
        _, slope = jax.jvp(self.problem.transform.to_physical, (y[:p],), (jnp.ones(p),))
        noise = jnp.sum(self.problem.runs.samples() * jnp.log(sigma), where=jnp.asarray(self.estimated))
        value = self._with(sigma).cost(y) + noise - jnp.sum(jnp.log(jnp.abs(slope)))
        return jnp.where(jnp.isfinite(value), value, jnp.inf)

    def split(self, at: Float[Array, " d"]) -> tuple[Float[Array, " y"], Float[Array, " c"]]:
        """The coordinates of the problem, and the noise of each channel."""
        which = np.flatnonzero(self.estimated)
        y = at[: len(at) - len(which)]
        return y, self.problem.sigma.at[which].set(jnp.exp(at[len(y) :]))

    def drawn(self, at: Float[Array, " d"]) -> tuple[Float[Array, " p"], Float[Array, "r s"], Float[Array, " c"]]:
        """Coefficients, initial states and noise, SI."""
        y, sigma = self.split(at)
        p = len(self.problem.prior_mean)
        theta = self.problem.transform.to_physical(y[:p])
        return theta, self.problem.initial_states(y), sigma

    def _with(self, sigma: Array) -> Problem:
        return dataclasses.replace(self.problem, sigma=sigma)


def _information(found: Solution, problem: Problem, estimated: tuple[bool, ...]) -> Float[Array, "d d"]:
    """Fisher's of (y, log σ) from the fit's own linearised model; a residual of unit size has 2 in log σ."""
    p = len(found.names)
    _, slope = jax.jvp(problem.transform.to_physical, (problem.origin,), (jnp.ones(p),))
    products = found.model.products
    corner = jnp.sum(products[:, :p, :p], axis=0) * jnp.outer(slope, slope) + jnp.diag((slope / problem.prior_std) ** 2)
    noise = jnp.diag(2.0 * problem.runs.samples()[np.flatnonzero(estimated)])
    if found.known_start:
        return jax.scipy.linalg.block_diag(corner, noise)
    mixed = jnp.moveaxis(products[:, :p, p:-1] * slope[:, None], 0, 1).reshape(p, -1)
    own = jax.scipy.linalg.block_diag(*(products[:, p:-1, p:-1] + jnp.eye(len(problem.start_std))))
    return jax.scipy.linalg.block_diag(jnp.block([[corner, mixed], [mixed.T, own]]), noise)


def posterior(found: Solution, *, draws: int = 1000, warmup: int = 300, chains: int = 4, seed: int = 0) -> Any:
    """Draws from the posterior of what `found` fitted: an ArviZ `InferenceData` (a `DataTree` from ArviZ 1 on).

    Group `posterior` holds each free coefficient under its name (chain, draw), `initial_state` (chain, draw, run,
    state) where it is not known, and `sigma` (chain, draw, channel) of the channels where it is estimated, all SI and
    coefficients with their `units`; `sample_stats` holds `diverging` and the like. There are `draws` in each of
    `chains`, drawn by `seed`. The chains start about the fit, its covariance is their metric and is not adapted; the
    step is, in `warmup` draws that are thrown away.

    Raises InputError without the packages of `pip install 'jaxsub[bayes]'`, and for a fit that leaves a direction open.
    """
    optional("numpyro", "bayes", "posterior")
    arviz = _arviz()
    target = Target.of(found)
    key, starts = jax.random.split(jax.random.key(seed))
    begin = scattered_starts(target, starts, chains)
    samples, statistics = _chains(target, jax.random.split(key, chains), begin, warmup, draws)
    theta, states, sigma = jax.jit(jax.vmap(jax.vmap(target.drawn)))(samples)
    values = {name: np.asarray(theta[..., i]) for i, name in enumerate(found.names)}
    if not found.known_start:
        values["initial_state"] = np.asarray(states)
    if any(target.estimated):
        values["sigma"] = np.asarray(sigma)[..., np.flatnonzero(target.estimated)]
    channels = [c for c, estimated in zip(found.vehicle.layout.channels, target.estimated, strict=True) if estimated]
    data = _from_dict(arviz, values, {name: np.asarray(field) for name, field in statistics.items()}, channels)
    for row in found.vehicle.layout.free:
        data["posterior"][row.name].attrs["units"] = row.unit
    return data


@compiled
def _chains(
    target: Target, keys: Key[Array, " n"], starts: Float[Array, "n d"], warmup: int, draws: int
) -> tuple[Float[Array, "n m d"], dict[str, Array]]:
    """What the sampler drew, and what it says of each draw under ArviZ's names.

    NumPyro's kernels and not its `MCMC`, which compiles the model four times.
    """
    hmc = optional("numpyro.infer.hmc", "bayes", "posterior").hmc
    at = optional("numpyro.infer.util", "bayes", "posterior").ParamInfo

    def chain(key: PRNGKeyArray, start: Float[Array, " d"]) -> tuple[Array, dict[str, Array]]:
        begin, advance = hmc(target, algo="NUTS")
        settings = {"dense_mass": True, "adapt_mass_matrix": False, "inverse_mass_matrix": target.covariance}
        state = begin(at(start, *jax.value_and_grad(target)(start)), warmup, rng_key=key, **settings)

        def step(state: Any, _: None) -> tuple[Any, tuple[Array, dict[str, Array]]]:
            state = advance(state)
            statistics = {"diverging": state.diverging, "lp": -state.potential_energy, "n_steps": state.num_steps}
            return state, (state.z, statistics | {"acceptance_rate": state.accept_prob})

        _, kept = jax.lax.scan(step, state, length=warmup + draws)
        return jax.tree.map(lambda leaf: leaf[warmup:], kept)

    return jax.vmap(chain)(keys, starts)


def scattered_starts(target: Target, key: PRNGKeyArray, chains: int) -> Float[Array, "n d"]:
    """Starts about the mode, drawn nearer to it, by halves, until the model runs from there."""
    step = jnp.linalg.cholesky(target.covariance) @ jax.random.normal(key, (len(target.mode), chains))
    near = target.mode + _APART * step.T
    density = jax.jit(jax.vmap(target))
    for _ in range(20):
        runs = jnp.isfinite(density(near))
        if bool(runs.all()):
            break
        near = jnp.where(runs[:, None], near, 0.5 * (near + target.mode))
    return near


def _arviz() -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)  # ArviZ 0 announces ArviZ 1 whenever it is imported
        return optional("arviz", "bayes", "posterior")


def _from_dict(
    arviz: Any, values: dict[str, np.ndarray], statistics: dict[str, np.ndarray], channels: list[str]
) -> Any:
    """ArviZ 1 takes the groups as one dictionary, ArviZ 0 each by its own name."""
    labels = {"dims": {"initial_state": ["run", "state"], "sigma": ["channel"]}, "coords": {"channel": channels}}
    groups = {"posterior": values, "sample_stats": statistics}
    if int(arviz.__version__.partition(".")[0]) < 1:
        return arviz.from_dict(**groups, **labels)
    return arviz.from_dict(groups, **labels)
