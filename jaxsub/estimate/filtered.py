"""Estimation by filters: parameters and state together, sample after sample."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..filter.defaults import vehicle_filter
from ..filter.ekf import AbstractFilter
from ..filter.mekf import ModifiedKalmanFilter
from ..filter.passes import identify
from ..filter.vehicle import VehicleProcess, samples
from ..programs import compiled
from ..results import NONFINITE, RESULTS, SUCCESSFUL
from .damped import Damped
from .method import AbstractMethod, Found, Passes, costs, holding, in_shares, lanes_for, objective, problems
from .pool import pool
from .problem import Problem

_SETTLED, _STEPS = 1e-5, 20


class Filtered(AbstractMethod):
    """A filter of state and parameters run over the recordings, `passes` times.

    Its estimate is not the maximum of the likelihood: it is as good as one linearised look at each sample is, and
    comes whatever the start. `Chain` completes it.

    **Fields**

    - `kind`: the modified extended Kalman filter of the paper, or the plain one.
    - `spread`: how far off the start is taken to be, in each parameter's own size.
    - `passes`: over the recordings; each begins with that spread again, so that no sample counts twice.
    """

    kind: type[AbstractFilter] = eqx.field(static=True, default=ModifiedKalmanFilter)
    spread: float = 1.0
    passes: int = eqx.field(static=True, default=2)

    def run(
        self,
        problem: Problem,
        starts: Float[Array, "n d"],
        outputs: Float[Array, "n r k c"] | None = None,
        passes: Passes | None = None,
    ) -> Found:
        """Filter from each of the `starts`. A filter that diverges ends as `nonfinite`. Not to be called in `jit`.

        **Raises** `InputError` as `VehicleProcess` does.
        """
        return in_shares(_filtered, self, problem, starts, outputs)


@compiled
def _filtered(method: Filtered, problem: Problem, starts: Array, outputs: Array | None) -> Found:
    of, lanes, p = problems(problem, outputs), lanes_for(problem), len(problem.prior_mean)
    process = VehicleProcess(problem.vehicle, problem.transform, problem.runs.substeps)
    filter = vehicle_filter(process, problem.sigma, method.kind)
    # a parameter that is held has no uncertainty to correct it by
    root = jnp.diag(jnp.where(problem.moving, method.spread, 0.0))

    def one(part: tuple[Array, Array]) -> tuple[Array, Array]:
        index, y = part
        found = identify(filter, samples(of(index).runs), problem.guess, y[:p], root, method.passes)
        return y.at[:p].set(found.theta), found.diverged

    y, diverged = jax.lax.map(one, (jnp.arange(len(starts)), starts), batch_size=lanes)
    if not problem.known_start:
        # a filter needs no initial state; the likelihood does, and the one that suits its parameters is meant
        settled = holding(of, y, jnp.zeros((len(y), p), bool))
        y = pool(Damped(Problem.expand, _SETTLED), objective, y, settled, lanes=lanes, max_steps=_STEPS).y
    result = jax.vmap(lambda gone: RESULTS.where(gone, NONFINITE, SUCCESSFUL))(diverged)
    return Found(y, costs(of, y, lanes), jnp.full(len(starts), method.passes), result)
