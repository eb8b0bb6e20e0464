"""Searches that begin anew where others ended stop where nothing that a decision needs is left to gain."""

import jax.numpy as jnp
import numpy as np
import pytest
from rigs import oscillator, recorded

from jaxsub.estimate import Problem, gauss_newton
from jaxsub.estimate.blockwise import GaussNewton
from jaxsub.estimate.damped import Damped


@pytest.fixture
def crawling():
    """A search so damped that its first dozen passes gain next to nothing, by what it may leave."""
    vehicle = oscillator()
    runs, stiffer = recorded(vehicle, 1, 80, 0.1, 3), vehicle.with_values({"K_x": np.array(5.0)})
    problem = Problem.of(stiffer, runs, jnp.array([0.01, 0.02]))
    damped = Damped(Problem.expand, 1e-5, first=1e12, within=Problem.bounds)
    return problem, lambda least: GaussNewton(damped, 60, least).run(problem, problem.coordinates()[None])


def test_a_search_that_crawls_ends_after_a_dozen_passes(crawling):
    """Claim: twelve passes that gain less than is negligible end it as unfinished; where nothing is, it arrives."""
    problem, search = crawling
    hasty, patient = search(0.1).one(0), search(0.0).one(0)
    best = gauss_newton().run(problem, problem.coordinates()[None]).one(0)
    assert int(hasty.evaluations) == 13
    assert float(hasty.cost) > float(best.cost) + 100.0
    assert "maximum number of steps" in str(hasty.result)
    assert float(patient.cost) == pytest.approx(float(best.cost), abs=1e-4)
    assert "maximum" not in str(patient.result)
