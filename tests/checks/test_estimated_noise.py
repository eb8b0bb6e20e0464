"""An estimated noise that is as large as what a channel shows is a warning, and no other noise is."""

import dataclasses

import numpy as np
import pytest
from rigs import oscillator

from jaxsub.api.diagnoses import _warned
from jaxsub.checks.estimated_noise import hardly_followed
from jaxsub.discrepancy import Conclusions
from jaxsub.discrepancy.records.diagnosis import ChannelQuality
from jaxsub.recording import Recording

TIMES = 0.1 * np.arange(200)
# of amplitude 1 about 5 and 7: the standard deviation within runs is 0.707 whatever they are about
RUNS = [Recording(f"run {n}", TIMES, {"x": n + np.sin(TIMES * np.pi)}, f"run{n}.csv") for n in (5, 7)]
OPEN = oscillator(outputs={"x": {"sigma": "estimate"}})


@pytest.mark.parametrize(("sigma", "count"), [(0.34, 0), (0.37, 1)])
def test_half_of_the_standard_deviation_within_runs_is_the_limit(sigma, count):
    found = hardly_followed(OPEN, {"x": sigma}, RUNS)
    assert len(found) == count
    assert all(one.severity == "warning" and one.channel == "x" and "0.707" in one.what for one in found)


def test_a_noise_that_the_file_states_and_a_channel_without_samples_are_passed_over():
    blank = [dataclasses.replace(RUNS[0], columns={"x": np.full(200, np.nan)})]
    assert hardly_followed(oscillator(outputs={"x": {"sigma": 0.1}}), {"x": 9.0}, RUNS) == []
    assert hardly_followed(OPEN, {"x": 9.0}, blank) == []


def test_a_diagnosis_that_hardly_follows_its_runs_says_so():
    """Claim: the warning is among the notes of the report and the findings of `diagnosis.json`."""
    quality = ChannelQuality("x", "", 400, 0.0, 0.6, True, 0.01)
    made = Conclusions(
        verdict="none", vehicle="rig", summary="-", p_value=1.0, where=[], physics=[], fit={}, candidates=[], forces=[],
        remaining_forces=[], overlays=[], coefficients=[], channels=[quality], runs=[], notes=["before"],
        next_manoeuvre=None,
    )  # fmt: skip
    warned = _warned(made, OPEN, RUNS)
    assert [finding.check for finding in warned.findings] == ["hardly-followed"]
    assert warned.notes[0] == "before" and "hardly follows" in warned.notes[1]
