"""In clean runs of other seeds and sensors no fault is named; faults of one channel or instrument are named as such."""

import dataclasses

import numpy as np
import pytest

from experiments.check_faults.faults import FAULTS
from experiments.check_faults.runs import SENSORS, clean_runs
from jaxsub.checks.consistency import consistency

SEEDS = range(500, 503)


@pytest.fixture(scope="module", params=SENSORS)
def runs(request):
    return clean_runs("surface vessel", request.param, SEEDS)


@pytest.fixture(scope="module")
def white():
    return clean_runs("surface vessel", "white", SEEDS)


def found(vehicle, run):
    return consistency(run, vehicle.layout, run.columns, 1.5)


def test_clean_runs_agree(runs):
    vehicle, made = runs
    assert [finding.line() for run in made for finding in found(vehicle, run)] == []


@pytest.mark.parametrize("arm", [-1.4, 1.4])
def test_a_receiver_off_the_origin_is_no_fault(white, arm):
    vehicle, made = white
    for run in made:
        psi = run.columns["psi"]
        moved = {"x": run.columns["x"] + arm * np.cos(psi), "y": run.columns["y"] + arm * np.sin(psi)}
        log = {"v": run.columns["v"] + arm * run.columns["r"]}
        for columns in (moved, log):
            assert found(vehicle, dataclasses.replace(run, columns=run.columns | columns)) == []


@pytest.mark.parametrize(
    ("name", "size"),
    [
        ("r late", 0.5), ("psi late", 0.5), ("u late", 1.0), ("r by a factor", 180.0 / np.pi), ("u by a factor", 1e3),
        ("r reversed", -1.0), ("v reversed", -1.0), ("x and y swapped", 1.0), ("u and v swapped", 1.0),
        ("r with an offset", 1.0),
    ],
)  # fmt: skip
def test_a_fault_is_named_in_every_run(white, name, size):
    vehicle, made = white
    for i, run in enumerate(made):
        findings = tuple(found(vehicle, FAULTS[name].put(run, size, np.random.default_rng(i))))
        assert FAULTS[name].named(findings), [finding.line() for finding in findings]


def test_a_rate_that_rests_while_its_angle_turns_is_a_contradiction(white):
    vehicle, made = white
    for i, run in enumerate(made):
        still = 1e-4 * np.random.default_rng(i).standard_normal(len(run.times))
        findings = found(vehicle, dataclasses.replace(run, columns=run.columns | {"r": still}))
        (finding,) = findings
        assert (finding.check, finding.channel) == ("contradiction", "psi") and "r hardly moves" in finding.what
