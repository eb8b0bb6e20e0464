"""A plan's chunks hold every search once, and a search's draws depend on its own place alone."""

import jax
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats
from sweep_cases import plan, recordings, vehicle

from jaxsub.errors import InputError
from jaxsub.estimate.method import share_for
from jaxsub.sweeps import Plan


@settings(derandomize=True, deadline=None, max_examples=100)
@given(
    starts=st.integers(1, 400),
    noise=st.integers(0, 4),
    vehicles=st.integers(1, 3),
    sets=st.integers(1, 3),
    widths=st.lists(st.integers(1, 500), min_size=9, max_size=9),
)
def test_chunks_hold_every_search_of_every_case_once(starts, noise, vehicles, sets, widths):
    body, runs = vehicle(), recordings()
    named = {f"v{i}": body for i in range(vehicles)}, {f"r{i}": runs for i in range(sets)}
    made = Plan(*named, starts, noise=range(noise), width=widths[: vehicles * sets])
    held = [(chunk.case, number) for chunk in made.chunks() for number in range(chunk.first, chunk.last)]
    assert held == [(case, n) for case in range(vehicles * sets) for n in range(starts * max(1, noise))]
    assert all(0 < chunk.last - chunk.first <= widths[chunk.case] for chunk in made.chunks())


@pytest.mark.parametrize("starts", [1, 64, 65, 1000, 100_000])
def test_chunks_are_whole_shares_of_bounded_memory_in_a_bounded_number_of_files(starts):
    made = plan(starts=starts, width=None)
    (problem,), chunks = made.problems, made.chunks()
    share = share_for(problem)
    assert all(chunk.first % share == 0 for chunk in chunks)
    assert len(chunks) <= 501
    assert chunks[0].last <= share or starts > 500 * share
    long = plan(recordings={"long": [r.resample(np.arange(0.0, 4.9, 1e-5)) for r in recordings()]}).problems[0]
    assert share_for(long) * long.runs.outputs.nbytes <= 1.0e9 < 1000 * long.runs.outputs.nbytes


def test_a_search_is_drawn_alike_in_any_part_of_a_sweep_and_in_a_longer_one():
    clean = {"run": recordings(noise=False)}
    whole, longer = plan(recordings=clean, noise=(7, 3)), plan(recordings=clean, noise=(3, 5, 7), starts=300)
    numbers = np.arange(whole.per_case)
    part = np.array([150, 3, 97])
    for draw in ("start_points", "outputs"):
        every = np.asarray(getattr(whole, draw)(0, numbers))
        np.testing.assert_array_equal(np.asarray(getattr(whole, draw)(0, part)), every[part])
        # the same starts and seeds stand elsewhere in the longer sweep
        there = np.array([54 + 300 * 0, 3 + 300 * 2, 1 + 300 * 0])
        np.testing.assert_array_equal(np.asarray(getattr(longer, draw)(0, there)), every[part])
        other = plan(recordings=clean, noise=(7, 3), seed=1)
        assert not np.any(np.asarray(getattr(other, draw)(0, part))[..., 0] == every[part][..., 0])


def test_starts_are_uniform_about_the_vehicle_and_noise_is_gaussian_of_its_sigma():
    clean = recordings(noise=False)
    made = plan(recordings={"run": clean}, starts=2000, noise=range(40), spread=0.4)
    problem = made.problems[0]
    theta = np.asarray(jax.vmap(problem.transform.to_physical)(made.start_points(0, np.arange(2000))[:, :3]))
    file = np.array([float(vehicle().values()[row.name]) for row in vehicle().layout.free])
    for column in (theta / file - 1.0).T:
        assert stats.kstest(column, stats.uniform(-0.4, 0.8).cdf).pvalue > 0.001
    assert np.abs(np.corrcoef(theta.T) - np.eye(3)).max() < 0.1
    outputs = np.asarray(made.outputs(0, np.arange(0, made.per_case, 2000)))
    error = (outputs - np.asarray(problem.runs.outputs)) / np.asarray(problem.sigma)
    assert stats.kstest(error.ravel(), "norm").pvalue > 0.001
    assert np.abs(np.corrcoef(error.reshape(40, -1)) - np.eye(40)).max() < 0.5


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"starts": 0}, "starts"),
        ({"vehicles": {}}, "vehicles"),
        ({"recordings": {}}, "recordings"),
        ({"spread": -0.1}, "spread"),
        ({"noise": (1, 1)}, "seeds"),
        ({"method": "newtn"}, "newtn"),
    ],
)
def test_a_plan_that_cannot_be_is_refused(changes, word):
    with pytest.raises(InputError, match=word):
        plan(**changes)
