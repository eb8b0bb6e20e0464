"""Searches that begin where others have ended, or from several vehicles at once."""

import dataclasses
from collections.abc import Sequence

import numpy as np
from jaxtyping import Array, Float

from ..recording.runs import Runs
from ..vehicle import AbstractVehicle
from .blockwise import Descent, raced
from .fitting import AbstractSearchEnd, SearchEnd, concentrated
from .method import AbstractMethod
from .methods import gauss_newton
from .problem import Problem

# of log likelihood: no decision between models hangs on less, and in a curved valley a search can crawl for long
_NEGLIGIBLE = 0.1
# passes between two estimates of standard deviations between runs, each of which is exact where the model is linear;
# the first half of them may be spent on finding a damping under which a step leads down
_PASSES = 12


def race(vehicles: Sequence[AbstractVehicle], runs: Runs, sigma: Float[Array, " c"]) -> SearchEnd:
    """The best of searches from several `vehicles`; those that fall behind are given up, and one that crawls ends.

    `runs` are stacked recordings, and `sigma` (c,) is the noise of their channels, SI.
    """
    begun = [Problem.of(vehicle, runs, sigma) for vehicle in vehicles]
    method = dataclasses.replace(gauss_newton(), least=_NEGLIGIBLE)
    best = raced([Descent(method, problem, problem.coordinates()) for problem in begun])
    found = best.found.one(0)
    fitted, states = best.problem.split(found.y)
    return SearchEnd(fitted, runs, states, best.problem.sigma, found.cost, found.evaluations, found.result)


def continued(ended: AbstractSearchEnd, spreads: Sequence[str] = (), method: AbstractMethod | None = None) -> SearchEnd:
    """The search on from the numbers and the initial states where it `ended`, or where another kind of search did.

    From the guess of its initial states alone the simulation of an unstable vehicle leads nowhere. The standard
    deviations between runs of the numbers `spreads` are open. `method` is Gauss–Newton where none is given.
    """
    problem = Problem.of(ended.vehicle, ended.runs, ended.sigma)
    y = problem.coordinates_of(ended.vehicle, ended.start)
    return concentrated(problem, y, np.zeros(len(ended.sigma), bool), tuple(spreads), method)


def with_estimated_spreads(ended: AbstractSearchEnd, names: Sequence[str]) -> SearchEnd:
    """The search on from where it `ended`, the standard deviations between runs of the numbers `names` open."""
    return continued(ended, names, dataclasses.replace(gauss_newton(), max_steps=_PASSES))
