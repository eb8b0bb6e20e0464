"""Designed manoeuvres tell the most that their limits allow, and keep those limits."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg
from hypothesis import given, settings
from hypothesis import strategies as st
from rigs import oscillator

from jaxsub.errors import InputError
from jaxsub.information.design_information import information, log_det
from jaxsub.information.design_limits import Bounds, ManoeuvreLimits, manoeuvre, template
from jaxsub.information.manoeuvre_design import design, keeping
from jaxsub.likelihood import linearise_runs
from jaxsub.simulation import at_rest, doublet, prbs, sampled_states, simulate, square, synthetic, three_two_one_one
from jaxsub.vehicle.catalogue import dsrv

TIMES = 0.2 * np.arange(76)
RIG = oscillator()
RESONANCE = {"D_x": 0.3, "K_x": 4.0, "B_x_drive": 2.0}


def driven(vehicle, signal, times=TIMES):
    return manoeuvre(vehicle, "run", times, np.asarray(signal)[:, None], {})


def only_free(vehicle, *names):
    rows = tuple(dataclasses.replace(row, free=row.name in names) for row in vehicle.layout.parameters)
    return dataclasses.replace(vehicle, layout=dataclasses.replace(vehicle.layout, parameters=rows))


@eqx.filter_jit
def whitened_output(vehicle, runs, start, sigma):
    return (simulate(vehicle, runs, start) / sigma).ravel()


@pytest.mark.parametrize("vehicle", [oscillator(), dsrv()], ids=["oscillator", "DSRV"])
def test_information_is_that_of_central_differences(vehicle):
    recording = driven(vehicle, prbs(len(TIMES), 8, 0.1, 3))
    sigma = np.array([output.sigma for output in vehicle.layout.outputs])
    names = [row.name for row in vehicle.layout.free]
    runs, start = template(vehicle, [recording]), at_rest(vehicle, 1)
    columns = []
    for name in names:
        h = 1e-4 * vehicle.values()[name]
        pair = (vehicle.with_values({name: vehicle.values()[name] + step}) for step in (h, -h))
        above, below = (np.asarray(whitened_output(moved, runs, start, sigma)) for moved in pair)
        columns.append((above - below) / 2e-4 * np.sign(vehicle.values()[name]))
    expected = np.stack(columns, 1).T @ np.stack(columns, 1)
    found = information(vehicle, recording)
    np.testing.assert_allclose(found.matrix, expected, rtol=1e-5, atol=1e-6 * np.abs(expected).max())
    np.testing.assert_allclose(found.log_det, np.linalg.slogdet(expected + np.eye(len(names)))[1], rtol=1e-5)
    np.testing.assert_allclose(found.per_second, np.trace(expected) / 15.0, rtol=1e-5)
    np.testing.assert_allclose(found.energy, 75 * 0.2 * 0.01, rtol=1e-12)


def test_prior_counts_as_information_held_beforehand():
    vehicle = oscillator()
    rows = [dataclasses.replace(r, prior_std=0.5) if r.name == "K_x" else r for r in vehicle.layout.parameters]
    informed = dataclasses.replace(vehicle, layout=dataclasses.replace(vehicle.layout, parameters=tuple(rows)))
    found = information(informed, driven(informed, np.zeros(len(TIMES))))
    # a run without motion leaves what was known: K_x = 4 to 0.5, the rest to their own sizes
    assert found.standard_errors == pytest.approx({"D_x": 1.0, "K_x": 0.125, "B_x_drive": 1.0})


def test_gradient_through_the_linearised_model_is_that_of_central_differences():
    vehicle = dsrv()
    times = 0.3 * np.arange(25)
    limits = ManoeuvreLimits({"delta_s": 0.2}, {"delta_s": 0.4}, energy=0.1)
    bounds = Bounds.of(vehicle, limits, times)
    runs = template(vehicle, [driven(vehicle, np.zeros(25), times)])

    @jax.jit
    def criterion(free):
        moved = dataclasses.replace(runs, signals=bounds.inputs(free)[None])
        return log_det(vehicle, linearise_runs(vehicle, moved, at_rest(vehicle, 1)))

    rng = np.random.default_rng(0)
    free = jnp.asarray(rng.standard_normal((25, 1)))
    gradient = jax.grad(criterion)(free)
    for way in rng.standard_normal((5, 25, 1)):
        difference = (criterion(free + 1e-5 * way) - criterion(free - 1e-5 * way)) / 2e-5
        np.testing.assert_allclose(np.sum(gradient * way), difference, rtol=1e-6)


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    amplitude=st.floats(1e-3, 10.0),
    rate=st.floats(1e-3, 100.0),
    energy=st.floats(1e-4, 1e3),
    size=st.floats(0.0, 50.0),
)
def test_inputs_keep_amplitude_rate_and_energy_whatever_is_asked(seed, amplitude, rate, energy, size):
    rng = np.random.default_rng(seed)
    times = np.cumsum(rng.uniform(0.05, 0.5, 30))
    bounds = Bounds.of(RIG, ManoeuvreLimits({"f": amplitude}, {"f": rate}, energy=energy), times)
    wanted = jnp.asarray(size * rng.standard_normal((30, 1)))
    gaps = np.diff(times)
    for inputs in (np.asarray(bounds.inputs(wanted)), np.asarray(bounds.follow(wanted))):
        assert np.all(np.abs(inputs) <= amplitude * (1 + 1e-12))
        assert np.all(np.abs(np.diff(inputs[:, 0])) <= rate * gaps * (1 + 1e-12) + 1e-15)
        assert np.abs(inputs[0, 0]) <= rate * gaps[0] * (1 + 1e-12)
        assert gaps @ inputs[:-1, 0] ** 2 <= energy * (1 + 1e-12)


def test_an_actuator_without_a_rate_limit_does_as_it_is_told():
    bounds = Bounds.of(oscillator(), ManoeuvreLimits({"f": 1.0}), TIMES)
    commands = prbs(len(TIMES), 3, 2.0, 0)[:, None]
    np.testing.assert_allclose(bounds.follow(jnp.asarray(commands)), 0.5 * commands, atol=1e-9)


@pytest.mark.long
def test_design_for_a_gain_alone_is_the_dominant_singular_vector_of_its_response():
    vehicle = only_free(oscillator(coefficients=RESONANCE), "B_x_drive")
    dt, energy, n = 0.1, 0.5, len(TIMES)
    # the sensitivity to a gain is the response itself: the best input of given energy maximises a quadratic form
    F = scipy.linalg.expm(dt * np.array([[-0.3, -4.0, 2.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]))
    impulse = [F[:2, 2]]
    for _ in range(n - 2):
        impulse.append(F[:2, :2] @ impulse[-1])
    rows = np.array(impulse) / [0.02, 0.01]
    T = np.concatenate([scipy.linalg.toeplitz(column, np.zeros(n - 1)) for column in rows.T])
    best = np.linalg.norm(T, 2) ** 2 * energy / dt
    found = design(vehicle, 0.5 * TIMES, ManoeuvreLimits({"f": 2.0}, energy=energy), searches=2, steps=60)
    assert 0.9995 * best < found.information.matrix[0, 0] < 1.0001 * best


def test_design_beats_every_standard_manoeuvre_of_its_energy_and_shakes_a_resonance_where_it_resonates():
    vehicle = oscillator(coefficients=RESONANCE)
    limits = ManoeuvreLimits({"f": 0.5}, {"f": 2.0}, energy=1.0)
    signals = [prbs(len(TIMES), hold, 0.5, seed) for hold in (1, 3, 7, 15, 30) for seed in range(4)]
    signals += [square(TIMES, period, 0.5) for period in (1.0, 2.0, 3.0, np.pi, 4.0, 8.0)]
    signals += [shape(TIMES, 0.0, width, 0.5) for shape in (doublet, three_two_one_one) for width in (0.8, 1.6, 2.0)]
    found = design(vehicle, TIMES, limits, steps=80)
    for signal in signals:
        # each with all of the energy that the design may spend, whatever that does to its amplitude and rate
        equal = signal * np.sqrt(1.0 / (0.2 * np.sum(signal[:-1] ** 2)))
        assert found.information.log_det > information(vehicle, driven(vehicle, equal)).log_det
    assert found.information.energy <= 1.0 + 1e-12
    inputs = found.recording.column("f")
    power = np.abs(np.fft.rfft(inputs, 16 * len(inputs))) ** 2
    omega = 2.0 * np.pi * np.fft.rfftfreq(16 * len(inputs), 0.2)
    assert power[np.abs(omega - 2.0) < 0.6].sum() > 0.8 * power.sum()


@pytest.mark.long
def test_design_and_its_rivals_keep_the_limits_of_channels():
    vehicle = dsrv()
    limits = ManoeuvreLimits({"delta_s": 0.2}, {"delta_s": 0.3}, {"theta": 0.15, "z": 1.0}, energy=0.2)
    wild = driven(vehicle, np.full(len(TIMES), 0.2))
    for recording in (design(vehicle, TIMES, limits, searches=1, steps=25).recording, keeping(vehicle, wild, limits)):
        (answer,) = synthetic(vehicle, [recording], seed=0, noise=False, states=sampled_states)
        assert np.abs(answer.column("theta")).max() <= 0.15 * (1 + 1e-9)
        assert np.abs(answer.column("z")).max() <= 1.0 * (1 + 1e-9)
        assert np.abs(np.diff(recording.column("delta_s"))).max() <= 0.3 * 0.2 * (1 + 1e-12)
        assert 0.2 * np.sum(recording.column("delta_s")[:-1] ** 2) <= 0.2 * (1 + 1e-12)


@pytest.mark.parametrize(
    ("limits", "named"),
    [
        (ManoeuvreLimits({}), "no amplitude for the actuator 'f'"),
        (ManoeuvreLimits({"f": 1.0, "g": 1.0}), "no amplitude 'g'"),
        (ManoeuvreLimits({"f": 1.0}, {"ff": 1.0}), "did you mean 'f'"),
        (ManoeuvreLimits({"f": 1.0}, channels={"x_rat": 1.0}), "did you mean 'x_rate'"),
        (ManoeuvreLimits({"f": 0.0}), "'f' is limited to 0.0"),
        (ManoeuvreLimits({"f": 1.0}, energy=float("nan")), "'energy' is limited to nan"),
    ],
)
def test_limits_that_do_not_fit_the_vehicle_are_refused(limits, named):
    with pytest.raises(InputError, match=named):
        design(oscillator(), TIMES, limits)


def test_vehicles_that_no_manoeuvre_can_be_designed_for_are_refused():
    silent = oscillator(outputs={"x": {"sigma": "estimate"}})
    for vehicle, named in ((silent, "noise of 'x'"), (only_free(oscillator()), "no free coefficient")):
        with pytest.raises(InputError, match=named):
            design(vehicle, TIMES, ManoeuvreLimits({"f": 1.0}))
