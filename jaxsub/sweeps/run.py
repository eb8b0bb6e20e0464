"""The searches of chunks, by the estimators' own pools: a function of the plan and the chunks, and of nothing else."""

from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..estimate import METHODS, Problem, ends
from ..estimate.method import share_for
from ..results import outcome_numbers
from .plan import Chunk, Plan

Answers = dict[str, np.ndarray]


def run_chunks(plan: Plan, chunks: Sequence[Chunk]) -> list[Answers]:
    """The answers of `chunks` of one case of `plan` and, but for the last of the case, of one width.

    Each is a dictionary of arrays over the chunk's n searches: `start`, `estimate` and `standard_error` (n, p) of the
    free coefficients, SI; `coordinates` (n, d) of the end; `cost`; `away`, how many standard errors the optimum may
    still be off; `evaluations`; and `outcome`, an index to `OUTCOMES`.
    """
    case = chunks[0].case
    problem, width = plan.problems[case], max(chunk.last - chunk.first for chunk in chunks)
    # a short chunk is filled up, so that what it holds is cut into the same shares as anywhere
    size = -(-width // share_for(problem)) * share_for(problem) if plan.per_case > share_for(problem) else width
    numbers = np.concatenate([np.minimum(chunk.first + np.arange(size), chunk.last - 1) for chunk in chunks])
    real = np.concatenate([np.arange(size) < chunk.last - chunk.first for chunk in chunks])
    starts = jnp.where(real[:, None], plan.start_points(case, numbers), jnp.nan)
    outputs = plan.outputs(case, numbers)
    found = METHODS[plan.method]().run(problem, starts, outputs)
    evaluated = ends(problem, found, outputs)
    answers = {
        "start": _physical(problem, starts),
        "estimate": evaluated.theta,
        "standard_error": evaluated.standard_errors,
        "coordinates": found.y,
        "cost": found.cost,
        "away": evaluated.away,
        "evaluations": found.evaluations,
        "outcome": outcome_numbers(evaluated.result),
    }
    whole = {name: np.asarray(values) for name, values in answers.items()}
    inside = [index * size + np.arange(chunk.last - chunk.first) for index, chunk in enumerate(chunks)]
    return [{name: values[own] for name, values in whole.items()} for own in inside]


def _physical(problem: Problem, starts: Float[Array, "n d"]) -> Float[Array, "n p"]:
    return jax.vmap(problem.transform.to_physical)(starts[:, : len(problem.prior_mean)])
