"""Frequencies of waves are tuned by the model's own columns."""

import dataclasses

import numpy as np
import pytest
from diagnosis_cases import INTERVAL, SAMPLES, recorded, wrong

from jaxsub.discrepancy.linearise.view import facts, look
from jaxsub.discrepancy.propose.tuned import tuned
from jaxsub.effects.environment import WaveForcing
from jaxsub.estimate import batch, fit

OMEGA = 1.3
LINE = 2.0 * np.pi / (SAMPLES * INTERVAL)


def seen(effect):
    view = look(fit(wrong(), batch(wrong(), recorded(effect, 5)[:2])), near=wrong())
    return view, facts(view)


@pytest.fixture(scope="module")
def shaken():
    return seen(WaveForcing("heave", 4000.0, -3000.0, OMEGA))


@pytest.mark.parametrize("off", [-0.6, -0.3, 0.5])
def test_a_wave_listed_beside_its_frequency_is_found_there(shaken, off):
    """Claim: from up to 0.6 of what the record resolves away, within a fiftieth of it; an equation at rest stays."""
    view, known = shaken
    beside = dataclasses.replace(known, tones={"heave": (OMEGA + off * LINE, 4.0), "pitch": ()})
    found = tuned(view, beside).tones
    assert abs(found["heave"][0] - OMEGA) < 0.02 * LINE
    assert found["pitch"] == ()


def test_where_no_wave_is_asked_for_all_stays_as_it_was():
    """Claim: of recordings without a wave every frequency is listed as it was."""
    view, known = seen(None)
    assert tuned(view, known) == known
    nothing = dataclasses.replace(known, tones={})
    assert tuned(view, nothing) is nothing
