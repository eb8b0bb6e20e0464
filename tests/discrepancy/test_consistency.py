"""A verdict agrees with its own numbers: none means a test run at its noise, and a name says what it explains."""

import dataclasses
import json
import math
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jaxsub.discrepancy.accept.verdict import Judged
from jaxsub.discrepancy.explain.consistency import assessed, compared, consistent, noise
from jaxsub.discrepancy.explain.summary import summary
from jaxsub.discrepancy.records.diagnosis import ChannelQuality, Explained, Location, Physics
from jaxsub.discrepancy.settings import LARGE_ERROR
from jaxsub.plain import finite_text, to_json
from jaxsub.recording import Recording

SIGMA = np.array([0.5, 2.0])
CHANNELS = ("v", "psi")
# what noise alone leaves
STILL = dict.fromkeys(CHANNELS, 1.0)
quick = settings(derandomize=True, deadline=None, max_examples=60)
sizes = st.floats(0.9, 20.0)


def simulated(*rms, seed=0, samples=400):
    """Rms, low ends of intervals and the assessment of white errors of that size in σ on two test runs."""
    rng = np.random.default_rng(seed)
    times = 0.1 * np.arange(samples)
    recordings = [Recording(f"run {i}", times, dict.fromkeys(CHANNELS, np.zeros(samples)), "test") for i in range(2)]
    error = [rng.standard_normal((samples, 2)) * SIGMA * np.array(rms) for _ in recordings]
    own = np.sqrt(np.mean(np.concatenate(error) ** 2, axis=0)) / SIGMA
    sized = dict(zip(CHANNELS, own.tolist(), strict=True))
    low = {c: 0.95 * value for c, value in sized.items()}
    return sized, low, assessed(error, recordings, dict(zip(CHANNELS, CHANNELS, strict=True)), SIGMA)


def explained(before, after, random=STILL):
    was, least, _ = simulated(*before)
    now, low, assessment = simulated(*after, seed=1)
    return compared(was, now, least, random, assessment), low, assessment


@quick
@given(v=sizes, psi=sizes, p_value=st.floats(0.0, 1.0))
def test_none_never_stands_beside_an_error_far_above_the_noise(v, psi, p_value):
    """Claim: with any channel's interval above 2 σ the verdict is unknown, with the reason; else it is left alone."""
    found, low, assessment = explained((v, psi), (v, psi))
    judged = consistent(Judged("none", [], p_value, ["said"]), found, low, assessment)
    far = [c for c in CHANNELS if low[c] > LARGE_ERROR]
    assert judged.verdict == ("unknown" if far else "none")
    assert judged.notes[0] == "said" and judged.p_value == (min(p_value, assessment.size) if far else p_value)
    assert all(f"σ in {channel}" in judged.notes[-1] for channel in far)
    said = summary("none", [], [], [], found, p_value)
    large = [one for one in CHANNELS if one in found.left]
    assert all(f"σ in {channel}" in said for channel in large)
    assert ("to its noise" in said) == (not large)


@pytest.mark.parametrize("verdict", ["named", "ambiguous", "unknown"])
def test_other_verdicts_are_left_alone(verdict):
    found, low, assessment = explained((9.0, 9.0), (9.0, 9.0))
    judged = Judged(verdict, [], 1e-9, [])
    assert consistent(judged, found, low, assessment) is judged


@quick
@given(v=sizes, psi=sizes, random=sizes)
def test_an_error_as_large_as_random_forces_make_it_is_no_mismatch(v, psi, random):
    """Claim: of a channel that random forces move, twice what they leave is far above it; what they leave is told."""
    expected = {"v": 1.0, "psi": random}
    found, low, assessment = explained((v, psi), (v, psi), random=expected)
    judged = consistent(Judged("none", [], 1.0, []), found, low, assessment)
    far = [c for c in CHANNELS if low[c] > LARGE_ERROR * expected[c]]
    assert judged.verdict == ("unknown" if far else "none")
    assert judged.decisions[-1].outcome == ("large" if far else "not large")
    assert bool(judged.notes) == bool(far)
    said = summary("none", [], [], [], found, 1.0)
    assert ("random disturbance forces leave" in said) == (max(found.left.values(), default=0.0) > LARGE_ERROR)
    assert f"{random:.3g} σ in psi" in said or not found.left.get("psi", 0.0) > LARGE_ERROR


def test_a_model_that_diverges_on_the_test_run_is_not_none():
    times = 0.1 * np.arange(50)
    run = Recording("run", times, dict.fromkeys(CHANNELS, np.zeros(50)), "test")
    wild = assessed([np.full((50, 2), np.nan)], [run], dict(zip(CHANNELS, CHANNELS, strict=True)), SIGMA)
    lost = dict.fromkeys(CHANNELS, math.nan)
    found = compared(lost, lost, lost, STILL, wild)
    assert found == Explained(None, {}, False, False)
    judged = consistent(Judged("none", [], 1.0, []), found, lost, wild)
    assert judged.verdict == "unknown" and "diverges" in judged.notes[-1]
    assert "diverges" in summary("unknown", [], [], [], found, 1.0)


@quick
@given(before=st.tuples(sizes, sizes), after=st.tuples(sizes, sizes))
def test_the_share_is_that_of_the_excess_variance(before, after):
    """Claim: 1 − Σ(rms²−1 after)/Σ(rms²−1 before), above zero where the error falls, None without excess."""
    found, _, _ = explained(before, after)
    was, low, _ = simulated(*before)
    now, _, _ = simulated(*after, seed=1)
    excess = [sum(max(value**2 - 1.0, 0.0) for value in rms.values()) for rms in (was, now)]
    if max(low.values()) <= 1.0:
        assert found.share is None
    else:
        assert found.share == pytest.approx(1.0 - excess[1] / excess[0])
        assert (found.share > 0.0) == (excess[1] < excess[0])
    assert set(found.left) <= set(CHANNELS) and all(value > 1.1 for value in found.left.values())


def test_noise_that_nobody_stated_is_the_white_part_of_what_is_left():
    row = ChannelQuality("v", "m/s", 400, 0.0, 0.5, False, 0.1)
    unstated = dataclasses.replace(row, sigma_estimated=True)
    np.testing.assert_array_equal(noise([row, unstated]), [0.5, 0.1])


def physics(**changes):
    one = Physics("crossflow-drag", "crossflow-drag[horizontal]", ["sway"], "-", 0.98, {}, [])
    return dataclasses.replace(one, **changes)


PLACE = Location("sway", 0.9, [], [])


def test_a_name_says_what_it_explains_and_what_is_left():
    said = summary("named", [physics()], [PLACE], [], Explained(0.97, {"psi": 1.4}), 0.0)
    assert said == (
        "The model lacks crossflow-drag, which acts in sway. "
        "The improved model removes 97 % of the test run's excess variance; psi is left at 1.4 σ."
    )
    assert "no channel is left above its noise" in summary("named", [physics()], [PLACE], [], Explained(0.999, {}), 0.0)
    assert "does not reduce" in summary("named", [physics()], [PLACE], [], Explained(-0.2, {"v": 3.0}), 0.0)
    assert "within its noise too" in summary("named", [physics()], [PLACE], [], Explained(None, {}), 0.0)
    lost = Explained(None, {"v": 1.3}, False, True)
    assert "The baseline diverges" in summary("named", [physics()], [PLACE], [], lost, 0.0)


@pytest.mark.parametrize(
    ("share", "said"), [(1.0, "all"), (0.999, "more than 99 %"), (0.001, "less than 1 %"), (0.5, "50 %")]
)
def test_percent_claims_no_more_than_there_is(share, said):
    assert f"removes {said} of" in summary("named", [physics()], [PLACE], [], Explained(share, {}), 0.0)


@quick
@given(
    verdict=st.sampled_from(["none", "named", "ambiguous", "unknown"]),
    share=st.none() | st.floats(-100.0, 1.0),
    runs=st.tuples(st.booleans(), st.booleans()),
    left=st.dictionaries(st.sampled_from(CHANNELS), st.floats(1.1, 1e9)),
    p_value=st.floats(0.0, 1.0) | st.just(math.nan),
)
def test_no_sentence_holds_a_number_that_is_none(verdict, share, runs, left, p_value):
    found = Explained(share, left, *runs)
    said = summary(verdict, [physics()] if verdict in ("named", "ambiguous") else [], [PLACE], [], found, p_value)
    assert not re.search(r"\b(nan|inf|None)\b", said) and said.endswith(".")


def test_numbers_that_are_not_finite_are_words_and_null():
    assert [finite_text(x) for x in (1.0 / 3.0, math.inf, -math.inf, math.nan)] == [
        "0.333", "beyond all bounds", "beyond all bounds", "undefined",
    ]  # fmt: skip
    assert json.loads(to_json({"rms": math.nan, "left": [math.inf]})) == {"rms": None, "left": [None]}
