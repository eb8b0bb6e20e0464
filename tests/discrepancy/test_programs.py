"""A diagnosis makes few programs, none for other recordings of about the same length, and decides without a test run.

A program takes 10 ms to be traced and read from the cache however little it does, and seconds to be compiled.
"""

import contextlib
import dataclasses

import jax
import numpy as np
import pytest
from diagnosis_cases import SMALL, recorded, require_named, wrong

from jaxsub.discrepancy import diagnose
from jaxsub.effects import SensorScale

MOST = 56
EFFECT = SensorScale("q", 0.05)


@contextlib.contextmanager
def programs():
    """A list that grows by an entry with every program that is compiled, or read from the cache, meanwhile."""
    made = []

    def note(event, *_, **__):
        if event.endswith("backend_compile_duration"):
            made.append(event)

    jax.monitoring.register_event_duration_secs_listener(note)
    yield made
    jax.monitoring.unregister_event_duration_listener(note)


@pytest.fixture(scope="module", params=[SMALL, pytest.param(None, marks=pytest.mark.long)], ids=["small", "whole"])
def told(request):
    """Of two lengths of runs, and of the second with noise in the place of the test run's outputs: all that is found.

    Of each the diagnosis, the improved vehicle and how many programs it made.
    """
    # those of other tests would be missing from the number
    jax.clear_caches()
    first, second = ([run.between(0.0, end) for run in recorded(EFFECT, seed)] for seed, end in ((5, 75.0), (6, 72.5)))
    rng = np.random.default_rng(1)
    noise = {name: rng.standard_normal(len(second[2].times)) for name in wrong().layout.channels}
    replaced = dataclasses.replace(second[2], columns={**second[2].columns, **noise})
    answers = []
    for runs in (first, second, [*second[:2], replaced]):
        with programs() as made:
            answers.append((*diagnose(wrong(), runs[:2], runs[2:], vocabulary=request.param), len(made)))
    return answers


def test_a_diagnosis_makes_few_programs(told):
    found, _, number = told[0]
    require_named(found, EFFECT)
    assert 0 < number <= MOST


def test_other_recordings_of_about_the_same_length_make_no_program(told):
    found, _, number = told[1]
    assert (found.verdict, number) == ("named", 0)


def decided(found, improved):
    """Every decision, and every number that is chosen or estimated."""
    parts = found.decisions, found.physics, found.candidates, found.fit["train"]
    return [*map(repr, parts), {name: float(value) for name, value in improved.values().items()}]


def test_nothing_of_the_test_run_takes_part_in_a_decision(told):
    """Claim: with noise in the place of the test run's outputs every decision and number is the same, bit by bit."""
    (found, improved, _), (again, another, _) = told[1:]
    assert found.decisions and decided(found, improved) == decided(again, another)
    assert found.fit["held_out"] != again.fit["held_out"]
