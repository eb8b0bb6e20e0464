"""The threshold follows from the tail of the statistic: levels, scales and autoregressions that are known come out."""

import jax
import numpy as np
import pytest

from jaxsub.monitoring.autoregression import Autoregression
from jaxsub.monitoring.calibration import peaks, tail_of


@pytest.mark.parametrize("scale", [1.0, 2.0])
def test_threshold_of_exponential_peaks_is_their_quantile(scale):
    """Independent exponential peaks, 360 an hour: the rate over h is 360 exp(-h/scale), here at a tenth an hour."""
    series = np.random.default_rng(1).exponential(scale, (20, 1800))
    tail = tail_of(series, 10.0, 0.1)
    assert tail.scale == pytest.approx(scale, rel=0.12)
    # neighbours within the quiet time are one alarm, which at these levels hardly happens
    assert tail.threshold(0.1) == pytest.approx(scale * np.log(3600.0), rel=0.1)
    assert tail.rate_of(tail.threshold(0.25)) == pytest.approx(0.25)


def test_an_alarm_lasts_until_the_statistic_was_low_for_the_quiet_time():
    """Claim: two crossings two parts apart are one alarm where the quiet time is three parts, and two where one."""
    series = np.array([[0.0, 5.0, 0.0, 7.0, 0.0, 0.0, 0.0, 0.0, 6.0, 0.0]])
    assert peaks(series, 4.0, 3).tolist() == [7.0, 6.0]
    assert peaks(series, 4.0, 1).tolist() == [5.0, 7.0, 6.0]


def test_drawn_series_have_the_autocorrelation_of_the_data():
    """A first-order autoregression of 0.7 beside white noise: order, coefficient and variance of what is drawn."""
    rng = np.random.default_rng(2)
    series = rng.standard_normal((4000, 2))
    for k in range(1, len(series)):
        series[k, 0] += 0.7 * series[k - 1, 0]
    model = Autoregression.of(series)
    assert np.asarray(model.coefficients)[0, 0] == pytest.approx(0.7, abs=0.05)

    def step(past, key):
        return model.next(past, key)

    keys = jax.random.split(jax.random.key(0), 3000)
    drawn = np.asarray(jax.lax.scan(step, model.start(8), keys)[1])[100:]
    correlation = np.mean(drawn[1:] * drawn[:-1], axis=(0, 1)) / np.mean(drawn**2, axis=(0, 1))
    np.testing.assert_allclose(correlation, [0.7, 0.0], atol=0.06)
    np.testing.assert_allclose(drawn.std(axis=(0, 1)), series.std(axis=0), rtol=0.06)
