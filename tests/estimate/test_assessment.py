"""Whether a model explains runs: false alarms are as rare as the level says, and misfits of every kind are named."""

import json

import numpy as np
import pytest
from scipy import signal, stats

from jaxsub.errors import InputError
from jaxsub.estimate import LEVEL, assess, assess_residuals, fit, require_free
from jaxsub.plain import to_json
from tests.rigs import oscillator, recorded

NAMES = ("v", "r")


def noise(seed, shape=(2, 400, 2)):
    return np.random.default_rng(seed).normal(size=shape)


def everywhere(residual):
    return np.ones(residual.shape, bool)


def judged(residual, **options):
    return assess_residuals(NAMES, residual, everywhere(residual), **options)


@pytest.mark.long
def test_white_residuals_of_right_size_are_rarely_rejected():
    """Claim: each test's false alarms over 1000 records are no more than twice the level, at 1 %; p-values spread."""
    found = [judged(noise(seed)) for seed in range(1000)]
    assert np.mean([not one.explains for one in found]) <= 2 * LEVEL
    size = np.array([one.channels[0].size for one in found])
    assert stats.kstest(size, "uniform").pvalue > 0.01
    for name in ("size", "white", "spikes"):
        assert np.mean([getattr(one, name) < LEVEL for one in found]) <= 2 * LEVEL


def test_size_of_coloured_noise_of_right_size_is_rarely_rejected():
    """Claim: where noise of the given σ is coloured, effective samples keep the test of size at its level."""
    rho = 0.8
    series = [signal.lfilter([np.sqrt(1 - rho**2)], [1, -rho], noise(seed), axis=1)[:, 50:] for seed in range(300)]
    assert np.mean([judged(one).size < LEVEL for one in series]) <= 4 * LEVEL


def test_fitted_numbers_take_their_degrees_of_freedom():
    """Claim: projecting out 40 columns makes the test of size no safer than `fitted` says."""
    basis = np.linalg.qr(np.random.default_rng(0).normal(size=(400, 40)))[0]
    p_values = []
    for seed in range(300):
        white = noise(seed, (400,))
        left = (white - basis @ (basis.T @ white)).reshape(1, 400, 1)
        p_values.append(assess_residuals(("v",), left, everywhere(left), fitted=40).channels[0].size)
    assert stats.kstest(p_values, "uniform").pvalue > 0.01


def test_verdict_of_large_residuals_names_channels_and_sizes():
    """Claim: the sentence says which channels are how many σ, the largest first, and what to do."""
    found = judged(noise(0) * np.array([32.0, 34.0]))
    assert not found.explains
    assert found.verdict().startswith("does not explain these runs: r 3")
    assert found.verdict().endswith("standard errors below hold only for a right model; try `jaxsub diagnose`")
    (warning,) = found.findings("a.csv")
    assert warning.severity == "warning" and "jaxsub diagnose" in warning.line()


def test_verdict_of_right_residuals_names_the_largest():
    """Claim: the sentence of a model that explains the runs names the largest rms."""
    found = judged(noise(0) * np.array([1.0, 1.05]))
    assert found.explains and not found.findings("a.csv")
    assert found.verdict().startswith("explains these runs: largest rms r 1.0")
    assert found.verdict().endswith("residuals are white")


@pytest.mark.parametrize("known", [True, False])
def test_coloured_residuals_are_named(known):
    """Claim: a slow residual as large as the noise is no explanation, whether σ is given or estimated."""
    slow = np.sin(np.linspace(0, 20, 400))[None, :, None] * np.array([1.4, 0.0])
    residual = (noise(0) + slow) / (1.0 if known else np.array([np.sqrt(2.0), 1.0]))
    found = judged(residual, known=[known] * 2)
    assert not found.explains and "v" in found.reason()
    assert (found.size is None) == (not known)


def test_spikes_are_named_where_noise_is_estimated():
    """Claim: two spikes of 100 σ, which make the estimated σ large, are no explanation."""
    residual = noise(0)
    residual[0, [50, 200], 0] = 100.0
    residual = residual / np.sqrt(np.mean(residual**2, (0, 1)))
    found = judged(residual, known=[False, False])
    assert not found.explains and "v has spikes" in found.reason()


def test_a_hair_too_large_over_a_million_samples_is_no_misfit():
    """Claim: σ rounded by 3 %, or a thousandth of colour, does not matter however many samples say so."""
    found = judged(1.03 * noise(0, (1, 1_000_000, 2)))
    assert found.size is not None and found.size < 1e-6
    assert found.explains


def test_rounding_of_runs_without_noise_is_no_misfit():
    """Claim: residuals far below σ explain the runs, coloured or not."""
    slow = 1e-9 * np.sin(np.linspace(0, 20, 800)).reshape(2, 400, 1) * np.ones(2)
    assert judged(slow).explains


def test_what_does_not_run_or_was_not_measured_is_said_without_nan():
    """Claim: residuals that are not finite, and channels without samples, reach neither sentence nor JSON as nan."""
    residual = noise(0)
    residual[0, 3, 0] = np.nan
    found = judged(residual)
    text = to_json(found.to_json())
    assert not found.explains and "does not run" in found.verdict()
    assert "nan" not in (text + found.verdict()).lower() and json.loads(text)["explains"] is False
    mask = everywhere(residual)
    mask[..., 0] = False
    assert [c.channel for c in assess_residuals(NAMES, residual, mask).channels] == ["r"]
    assert not assess_residuals(NAMES, residual, np.zeros_like(mask)).explains
    assert assess_residuals(NAMES, np.full_like(residual, 1e200), everywhere(residual)).explains is False


def test_right_model_explains_its_own_runs_and_a_wrong_one_does_not():
    """Claim: a fitted oscillator explains runs it could have made; with its spring locked at twice, it does not."""
    runs = recorded(oscillator(), 2, 300, 0.1, seed=3)
    assert assess(fit(oscillator(), runs)).explains
    stiff = {"D_x": 0.6, "K_x": {"value": 8.0, "fixed": True}, "B_x_drive": 2.0}
    assert not assess(fit(oscillator(coefficients=stiff), runs)).explains


def test_vehicle_without_free_coefficients_is_refused():
    """Claim: one line names the file and what to do."""
    fixed = {name: {"value": 1.0, "fixed": True} for name in ("D_x", "K_x", "B_x_drive")}
    with pytest.raises(InputError, match=r"a\.toml: all coefficients are fixed"):
        require_free(oscillator(coefficients=fixed), "a.toml")
    require_free(oscillator(), "a.toml")
