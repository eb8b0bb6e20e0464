"""What the experiment on concealed physics does to clean measurements is what its conditions say."""

import numpy as np
import pytest

from experiments.concealed_physics.bodies import INTERVAL
from experiments.concealed_physics.logs import LOGGED, white
from experiments.concealed_physics.plan import CONDITIONS, Way, cases

SIGMA = np.array([0.1, 2.0, 5.0])


@pytest.fixture
def logged():
    """Two runs of three channels at rest, as one condition records them."""
    return lambda name: LOGGED[name](np.zeros((2, 900, 3)), SIGMA, np.random.default_rng(4)) / SIGMA


def test_a_tenth_of_all_samples_are_outliers(logged):
    """Claim: about a tenth of the samples are far outside the noise, and the others are the noise."""
    far = np.abs(logged("outliers")) > 4.0
    # of outliers spread evenly over 20 sigma to each side a fifth lie inside
    assert np.mean(far) == pytest.approx(0.08, abs=0.015)


def test_one_sensor_of_each_run_is_silent_for_twenty_seconds(logged):
    """Claim: each run lacks one stretch of one channel, 20 s long."""
    for run in np.isnan(logged("dropout")):
        (channel,) = np.flatnonzero(run.any(axis=0))
        silent = np.flatnonzero(run[:, channel])
        assert len(silent) * INTERVAL == pytest.approx(20.0) and np.ptp(silent) == len(silent) - 1


def test_slow_sensors_have_a_sample_a_second_and_uneven_ones_half(logged):
    """Claim: all channels have every fifth sample in the one, and the same half of the samples in the other."""
    slow, uneven = (np.isfinite(logged(name)) for name in ("slow", "uneven"))
    assert np.all(slow == (np.arange(900) % 5 == 0)[:, None])
    assert np.all(uneven == uneven[..., :1]) and np.mean(uneven) == pytest.approx(0.5, abs=0.05)


def test_quantised_sensors_show_whole_steps_and_noise_varies_six_fold(logged):
    """Claim: numbers are multiples of 4 sigma; where noise is least and most its size is a half and three sigma."""
    steps = logged("quantised") / 4.0
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-12)
    varying = logged("varying_noise").reshape(2, 3, 300, 3)
    assert np.std(varying[:, :, 140:160]) == pytest.approx(3.0, abs=0.4)
    assert np.std(np.concatenate([varying[:, :, :10], varying[:, :, -10:]], axis=2)) == pytest.approx(0.5, abs=0.1)


def test_conditions_are_recorded_so_and_leave_earlier_seeds_as_they_were():
    """Claim: each way of recording is a condition, and one of clean cases; new conditions leave seeds as they were."""
    assert all(CONDITIONS[name].ways == (Way(logs=name),) for name in LOGGED)
    assert set(LOGGED) < {case.way.logs for case in cases("none_logs", CONDITIONS["none_logs"].planned)}
    seeds = {"none_double": 13_000, "estimated": 14_000, "quantised": 20_000, "closed_loop": 21_000}
    assert {name: cases(name, 1)[0].seed for name in seeds} == seeds
    assert np.std(white(np.zeros((1, 4000, 3)), SIGMA, np.random.default_rng(1)) / SIGMA) == pytest.approx(
        1.0, abs=0.03
    )
