"""What an alarm found gets the name of the effect that made it."""

import numpy as np
import pytest
from rigs import driven, oscillator

from jaxsub.monitoring import model_by_noise, rows_of
from jaxsub.monitoring.naming import ROWS, Recent, named_effects
from jaxsub.simulation import sampled_states, synthetic


def test_recent_rows_are_bounded():
    """Claim: of twice as many rows the last are kept, and those later than a time are counted."""
    recent = Recent()
    for k in range(2 * ROWS):
        assert recent.full == (k >= ROWS)
        recent.add(np.array([float(k), 0.0]), np.zeros(1))
    assert len(recent.states) == ROWS
    assert recent.since(2.0 * ROWS - 11.0) == 10


@pytest.mark.long
def test_a_bias_is_named_at_its_size():
    """Claim: of all effects of the vocabulary a bias of x is the most probable, within three standard errors."""
    vehicle, dt, bias = oscillator(), 0.1, 0.05
    run = driven(vehicle, dt * np.arange(ROWS), seed=2, amplitude=1.0)
    rows = rows_of(vehicle, synthetic(vehicle, [run], seed=2, states=sampled_states))
    rows[800:, 2] += bias
    # 224 samples of 1 % of the coordinate's noise each
    recent = Recent(list(rows), [rows[0, [3, 2]]] * ROWS)
    first, *_ = named_effects(model_by_noise(vehicle, dt)[0], recent, 80.0)
    assert (first["effect"], first["where"]) == ("sensor-bias", ["sensor:x"])
    assert first["parameters"]["bias"] == pytest.approx(bias, abs=3.0 * 0.01)
