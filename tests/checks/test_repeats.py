"""Stuck, slow, constant and clipped channels and spikes are found; steps, pulses and coarse sensors are not."""

import numpy as np
import pytest
from check_cases import changed, clean, found, vehicle_named, with_values

from jaxsub.checks import check
from jaxsub.checks.channels import Channel
from jaxsub.checks.repeats import clipped, slow_sensor, stuck
from jaxsub.checks.spikes import spikes
from jaxsub.recording import Recording

W = Channel("w", "w", "measured", "m/s", 0.01)


def one(values, dt=0.1):
    values = np.asarray(values, float)
    return Recording("run", dt * np.arange(len(values)), {"w": values}, "run.csv"), W, values


def smooth(seed, count=1000):
    """A smooth motion, as of a vehicle in waves."""
    draws = np.random.default_rng(seed)
    steps = draws.standard_normal(count + 60)
    return np.convolve(np.convolve(steps, np.ones(30) / 30.0, "same"), np.ones(20) / 20.0, "same")[30:-30]


@pytest.mark.parametrize("seed", range(5))
def test_a_sensor_that_logs_zeros_is_masked(seed):
    draws = np.random.default_rng(seed)
    first, length = draws.integers(20, 500), draws.integers(12, 60)
    checked = check(vehicle_named("dsrv"), [with_values(clean("dsrv"), "w", slice(first, first + length), 0.0)])
    (finding,) = found(checked, "stuck")
    assert (finding.severity, finding.count) == ("warning", length) and "stuck at 0 m/s" in finding.what
    assert finding.rows == ((2 + first, 1 + first + length),)
    assert np.isnan(checked.recordings[0].columns["w"][first : first + length]).all()


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("quantum", [0.001, 0.01, 0.05])
def test_a_coarse_sensor_is_neither_stuck_nor_slow_nor_clipped_nor_spiky(seed, quantum):
    noise = np.random.default_rng(seed).choice([0.0, 0.003, 0.03]) * np.random.default_rng(seed).standard_normal(1000)
    run = one(quantum * np.round((smooth(seed) + noise) / quantum))
    assert stuck(*run)[1] == [] and slow_sensor(*run)[1] == [] and clipped(*run) == [] and spikes(*run, True)[1] == []


@pytest.mark.parametrize("slope", [0.001, 0.0033, 0.01])
def test_a_coarse_ramp_is_no_slow_sensor(slope):
    assert slow_sensor(*one(0.01 * np.round(slope * np.arange(1000) / 0.01)))[1] == []


@pytest.mark.parametrize("every", [2, 3, 10, 25])
@pytest.mark.parametrize("quantum", [0.0, 0.01])
@pytest.mark.parametrize("phase", [0, 1])
def test_a_slow_sensor_in_fast_rows_is_taken_once(every, quantum, phase):
    reading = smooth(every, 2000)[::every] + 0.005 * np.random.default_rng(every).standard_normal(
        len(range(0, 2000, every))
    )
    if quantum:
        reading = quantum * np.round(reading / quantum)
    values = np.repeat(reading, every)[phase:2000]
    mended, (note,) = slow_sensor(*one(values))
    assert note.severity == "note"
    kept = np.flatnonzero(np.isfinite(mended))
    assert set(np.diff(kept)) == {every} and (kept[0] + phase) % every == 0
    np.testing.assert_array_equal(mended[kept], values[kept])


def test_a_slow_sensor_of_no_whole_period_is_taken_once():
    reading = smooth(0, 400)
    values = reading[np.floor(np.arange(1000) * 0.3).astype(int)]
    mended, (note,) = slow_sensor(*one(values))
    assert note.count == 1000 - 300 and np.isfinite(mended).sum() == 300


def test_a_constant_channel_is_warned_about():
    checked = check(vehicle_named("dsrv"), [changed(clean("dsrv"), w=np.full(600, 0.25))])
    (finding,) = found(checked, "constant")
    assert finding.severity == "warning" and "0.25 m/s" in finding.what


@pytest.mark.parametrize("seed", range(5))
def test_clipping_is_warned_about(seed):
    values = smooth(seed) + 0.002 * np.random.default_rng(seed).standard_normal(1000)
    level = float(np.percentile(values, 90.0))
    (finding,) = clipped(*one(np.minimum(values, level)))
    assert finding.count == pytest.approx(100, abs=2) and "clipped" in finding.what
    assert clipped(*one(values)) == []


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("name", ["w", "q", "theta"])
def test_spikes_are_masked_and_nothing_else_is(seed, name):
    draws = np.random.default_rng(seed)
    rows = np.sort(draws.choice(np.arange(2, 598), draws.integers(1, 4), replace=False))
    size = np.ptp(clean("dsrv").columns[name]) * draws.uniform(0.7, 1.5, len(rows)) * draws.choice([-1.0, 1.0])
    values = clean("dsrv").columns[name].copy()
    values[rows] += size
    checked = check(vehicle_named("dsrv"), [changed(clean("dsrv"), **{name: values})])
    (finding,) = found(checked, "spike")
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(checked.recordings[0].columns[name])), rows)
    assert finding.severity == "warning" and finding.count == len(rows) and "its differences are" in finding.what


@pytest.mark.parametrize("seed", range(20))
def test_steps_and_pulses_of_a_motion_are_no_spikes(seed):
    draws = np.random.default_rng(seed)
    levels = np.repeat(draws.choice([-1.0, 1.0], 40), 25) + 0.01 * draws.standard_normal(1000)
    assert spikes(*one(levels), True)[1] == []
    # the answer of a first-order lag to pulses of three samples
    pushes = np.convolve((draws.uniform(size=1000) < 0.01).astype(float), np.ones(3))
    pulses = np.convolve(pushes, np.exp(-np.arange(50) / 5.0))[:1000]
    assert spikes(*one(pulses + 0.002 * draws.standard_normal(1000)), True)[1] == []
    # impacts, whose differences have long tails
    assert spikes(*one(draws.laplace(size=1000)), True)[1] == []
