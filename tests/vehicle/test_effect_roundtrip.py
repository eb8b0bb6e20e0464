"""A vehicle with any effect of the vocabulary is written and read back the same, and answers the same and finitely."""

import dataclasses
import tomllib

import jax.numpy as jnp
import numpy as np
import pytest
from rigs import body, chosen, coupled, driven, stacked

from jaxsub.effects import (
    VOCABULARY,
    AbstractMemory,
    SmoothForce,
    WaveForcing,
    options,
)
from jaxsub.simulation import at_rest, simulate
from jaxsub.vehicle import read_vehicle, vehicle_from, vehicle_text, write_vehicle

BODY, RIG = body(), coupled()


def test_every_effect_is_tried_here():
    assert {type(effect) for vehicle in (BODY, RIG) for effect in chosen(vehicle)} == set(VOCABULARY)


@pytest.mark.parametrize("plain", [BODY, RIG], ids=lambda vehicle: vehicle.layout.name)
def test_a_vehicle_with_every_effect_reads_back_the_same_and_answers_the_same(plain, tmp_path):
    vehicle = plain
    for effect in chosen(plain):
        vehicle = vehicle.with_effect(effect)
    write_vehicle(vehicle, tmp_path / "vehicle.toml")
    again = read_vehicle(tmp_path / "vehicle.toml")
    assert vehicle_text(again) == vehicle_text(vehicle)
    assert {n: float(v) for n, v in again.values().items()} == {n: float(v) for n, v in vehicle.values().items()}
    assert again.layout.positions == vehicle.layout.positions
    bare = lambda v: dataclasses.replace(v.layout, parameters=())
    assert bare(again) == bare(vehicle)
    runs = stacked(vehicle, [driven(vehicle, 0.1 * np.arange(12), seed=1, hold=3)])
    one, two, without = (simulate(v, runs, at_rest(v, 1)) for v in (vehicle, again, plain))
    assert np.isfinite(one).all()
    assert np.abs(one - without).max() > 0.01
    np.testing.assert_array_equal(one, two)


def test_a_smooth_force_keeps_its_edges_and_what_is_known_of_its_heights(tmp_path):
    """Claim: edges of either sign and the spread are read back, and the heights' prior is about zero."""
    force = SmoothForce("heave", "w", -0.4, 0.3, 2.5, a_0=jnp.asarray(1.7))
    write_vehicle(BODY.with_effect(force), tmp_path / "vehicle.toml")
    again = read_vehicle(tmp_path / "vehicle.toml")
    assert options(again.effects[0]) == options(force)
    rows = [row for row in again.layout.parameters if row.name.startswith(force.label)]
    assert {(row.prior_mean, row.prior_std) for row in rows} == {(0.0, 2.5)}
    assert float(again.values()[f"{force.label}.a_0"]) == 1.7
    unknown = dataclasses.replace(force, spread=np.inf)
    assert "spread" not in vehicle_text(BODY.with_effect(unknown))
    assert vehicle_from(tomllib.loads(vehicle_text(BODY.with_effect(unknown))), "").effects[0].spread == np.inf


def test_an_effect_that_is_taken_away_leaves_the_vehicle_as_it_was():
    vehicle = BODY
    for effect in chosen(BODY):
        vehicle = vehicle.with_effect(effect)
    states = [state for e in vehicle.effects if isinstance(e, AbstractMemory) for state in e.states]
    assert states
    assert vehicle.layout.positions == (*BODY.layout.positions, *states)
    for effect in chosen(BODY):
        vehicle = vehicle.without_effect(effect.label)
    assert vehicle.layout == BODY.layout


def test_a_wave_keeps_its_phase_between_samples_and_in_pieces_of_a_run():
    """Heave alone under a wave is m ż̈ + d ż = a cos ωt, whose solution is known; halves of a run go on in time."""
    plain = vehicle_from(
        {"schema": 1, "name": "float", "kind": "submerged-body", "dof": ["heave"], "body": {"mass": 2.0},
         "coefficients": {"Z_w": -3.0}, "outputs": {"w": {"sigma": 0.01}}}, "float.toml",
    )  # fmt: skip
    wave = WaveForcing("heave", jnp.asarray(1.4), jnp.asarray(-0.6), jnp.asarray(1.9))
    vehicle, times = plain.with_effect(wave), 0.05 * np.arange(81)
    runs = stacked(vehicle, [driven(vehicle, times, seed=1)])
    found = np.asarray(simulate(vehicle, runs, at_rest(vehicle, 1)))[0, :, 0]
    steady = (1.4 + 0.6j) / (2.0 * 1.9j + 3.0)
    expected = np.real(steady * np.exp(1.9j * times)) - np.real(steady) * np.exp(-1.5 * times)
    np.testing.assert_allclose(found, expected, atol=1e-6)
    halves = runs.segments(2)
    start = at_rest(vehicle, 2).at[1, 0].set(expected[40])
    second = np.asarray(simulate(vehicle, halves, start))[1, :, 0]
    np.testing.assert_allclose(second, expected[40:], atol=1e-6)
