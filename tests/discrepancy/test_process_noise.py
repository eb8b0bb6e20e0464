"""A filter's process noise rises where and while physics is missing, and on clean runs as seldom as is said."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from diagnosis_cases import INTERVAL, SAMPLES

from jaxsub.discrepancy.explain.locate import Field, locations, traces
from jaxsub.discrepancy.explain.process_noise import NoiseSignal, calibrated, noise_note, noise_signals
from jaxsub.discrepancy.linearise.view import look
from jaxsub.effects import ActuatorLag
from jaxsub.estimate import batch, fit
from jaxsub.recording import Recording
from jaxsub.simulation import Sampled, at_rest, prbs
from jaxsub.simulation.sampled import measure
from jaxsub.vehicle.catalogue import dsrv

EVENT = (30.0, 50.0)
TIMES = INTERVAL * np.arange(SAMPLES)
EQUATIONS = ("heave", "pitch")
# forces that move w and q by a few times their noise
SIZES = {"heave": 120.0, "pitch": 120.0}


def known():
    """The DSRV with nothing to fit: what is missing cannot hide in a coefficient."""
    vehicle = dsrv()
    rows = tuple(dataclasses.replace(row, free=False) for row in vehicle.layout.parameters)
    return dataclasses.replace(vehicle, layout=dataclasses.replace(vehicle.layout, parameters=rows))


def recorded(equation, seed):
    """Two runs, of which the second has a force in one equation from 30 to 50 s."""
    vehicle = known()
    columns = {name: np.full(SAMPLES, np.nan) for name in vehicle.layout.channels}
    driven = [
        Recording(f"run{i}", TIMES, columns | {"delta_s": prbs(SAMPLES, 12, 0.2, 100 * seed + i)}, "test")
        for i in range(2)
    ]
    runs = batch(vehicle, driven)
    push = np.zeros((2, SAMPLES - 1, 2, 2))
    if equation is not None:
        acts = (TIMES[:-1] >= EVENT[0]) & (TIMES[1:] <= EVENT[1])
        push[1, acts, :, EQUATIONS.index(equation)] = SIZES[equation]
    states = Sampled.of(vehicle, runs).states(runs, at_rest(vehicle, 2), jnp.asarray(push))
    shown = np.asarray(measure(vehicle, runs, states))
    sigma = np.array([output.sigma for output in vehicle.layout.outputs])
    shown = shown + sigma * np.random.default_rng(seed).normal(size=shown.shape)
    named = [dict(zip(vehicle.layout.channels, z.T, strict=True)) for z in shown]
    return [dataclasses.replace(r, columns=r.columns | z) for r, z in zip(driven, named, strict=True)]


def fitted(runs):
    vehicle = known()
    return fit(vehicle, runs)


@pytest.mark.parametrize("equation", ["pitch", pytest.param("heave", marks=pytest.mark.long)])
def test_it_rises_in_the_equation_and_at_the_time(equation):
    runs = recorded(equation, 1)
    clean, missing = noise_signals(fitted(runs), runs)
    assert (clean.run, clean.ranked()) == ("run0", [])
    assert missing.ranked()[0] == equation
    # elsewhere, too, it rises by chance once in twenty runs
    ((start, end),) = [(a, b) for a, b in missing.intervals(equation) if a < EVENT[1] and b > EVENT[0]]
    assert abs(start - EVENT[0]) < missing.window
    assert abs(end - EVENT[1]) < missing.window
    # Q_ii itself, above its constant part
    part = missing.std[equation] ** 2 - missing.std[equation].min() ** 2
    during, before = ((a < TIMES) & ~(b < TIMES) for a, b in ((EVENT[0] + 2.0, EVENT[1]), (10.0, EVENT[0])))
    assert part[during].mean() > 3.0 * part[before].mean()


@pytest.mark.long
def test_locate_takes_it_as_evidence_and_a_note_says_it():
    runs = recorded("heave", 1)
    found = fitted(runs)
    signals = noise_signals(found, runs)
    view = look(found)
    (first,) = locations(Field({}, traces(view, runs), signals), view, runs, {"heave": 1.0})
    covered = sum(min(b, EVENT[1]) - max(a, EVENT[0]) for run, a, b in first.times if run == "run1")
    assert covered > 0.8 * (EVENT[1] - EVENT[0])
    (line,) = noise_note(signals)
    assert "rises in heave (run1: " in line
    assert noise_note([]) == []


def test_a_force_that_is_not_clear_alone_counts_where_the_filter_agrees():
    runs = recorded(None, 1)
    found = fitted(runs)
    view = look(found)
    field = Field({}, traces(view, runs))
    times = field.traces[1].times
    doubtful = dataclasses.replace(
        field.traces[1],
        force={e: np.where((times > 30.0) & (times < 50.0), 2.0, 0.0) * (e == "heave") for e in EQUATIONS},
        band={e: np.ones_like(times) for e in EQUATIONS},
    )
    rising = {e: np.where((TIMES > 30.0) & (TIMES < 50.0), 5.0, 1.0) for e in EQUATIONS}
    signal = NoiseSignal("run1", TIMES, 12.5, rising, rising, 2.0)
    alone = dataclasses.replace(field, traces=[field.traces[0], doubtful])
    together = dataclasses.replace(alone, signals=[signal])
    share = {"heave": 1.0}
    assert locations(alone, view, runs, share)[0].times == []
    ((run, start, end),) = locations(together, view, runs, share)[0].times
    assert run == "run1"
    assert abs(start - 30.0) < 2.0 and abs(end - 50.0) < 2.0


def test_clean_data_are_above_the_threshold_as_often_as_is_said():
    """Densities with an exponential law and a memory, like the rule's, of which every equation has its own size."""
    rng = np.random.default_rng(0)
    alarms, trials, lengths = 0, 400, np.array([200, 150])
    for _ in range(trials):
        # twenty densities of one law: which of them is the recording is a matter of chance
        drawn = rng.exponential(size=(20, 2, 200, 2)) * np.array([1.0, 50.0])
        drawn = drawn + np.concatenate([np.zeros_like(drawn[:, :, :1]), drawn[:, :, :-1]], axis=2)
        ratio, threshold = calibrated(drawn[:-1], drawn[-1], lengths)
        alarms += bool(ratio.max() > threshold)
        assert (ratio[1, 150:] == 0.0).all()
    assert abs(alarms / trials - 0.05) < 3.0 * np.sqrt(0.05 * 0.95 / trials)


def test_where_no_filter_can_follow_there_is_no_signal():
    runs = recorded(None, 1)
    found = fitted(runs)
    lagged = found.vehicle.with_effect(ActuatorLag("stern_plane", jnp.asarray(0.4)))
    assert noise_signals(dataclasses.replace(found, vehicle=lagged), runs) == []
    # unstable to the point that the clean copies themselves run away
    wild = found.vehicle.with_values({"Z_w": jnp.asarray(1e6)})
    assert noise_signals(dataclasses.replace(found, vehicle=wild), runs) == []


def test_gaps_in_the_recording_raise_no_alarm():
    runs = recorded(None, 3)
    gaps = np.random.default_rng(4).random(SAMPLES) < 0.3
    thinned = [dataclasses.replace(r, columns=r.columns | {"w": np.where(gaps, np.nan, r.column("w"))}) for r in runs]
    assert [signal.ranked() for signal in noise_signals(fitted(thinned), thinned)] == [[], []]
