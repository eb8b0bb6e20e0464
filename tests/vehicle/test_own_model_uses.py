"""What a model of a user's own has beside fits: a controller, a filter, sweeps, a watch and a diagnosis."""

import dataclasses
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from test_own_models import CASES, Tank, driven

import jaxsub as js
from jaxsub.control import FinLimits
from jaxsub.effects import ActuatorLag
from jaxsub.errors import InputError
from jaxsub.vehicle import AbstractVehicle


class Gauged(Tank):
    """The tank without the gauge that shows its weight."""

    outputs: ClassVar = {"level": 0.002}


R, K, D = 2.0, 0.5, 0.01  # of the motor


def runs_of(vehicle: AbstractVehicle, case: str, count: int = 2, samples: int = 150) -> list[js.Recording]:
    """Recordings of a vehicle in that case, each with an input of its own."""
    model, _, dt, size, begin = CASES[case]
    runs = [driven(model, dt, size, seed=seed, samples=samples)[1] for seed in range(1, count + 1)]
    runs = [dataclasses.replace(run, name=f"run {i}", source=f"run {i}") for i, run in enumerate(runs)]
    return js.synthetic(vehicle, runs, seed=3, start=jnp.tile(jnp.array(begin), (count, 1)))


def test_a_motor_is_brought_to_a_speed_at_its_trim():
    """Claim: the trim has the voltage of the equations at rest, and predictive control ends at the speed wanted."""
    motor, _ = driven(CASES["motor"][0], 0.01, 6.0)
    plant = js.discretise(motor, 0.02)
    at = js.trim(plant, {"speed": 10.0})
    np.testing.assert_allclose(at.u, [(R * D / K + K) * 10.0], rtol=1e-7)
    assert float(js.trim(plant).u[0]) == pytest.approx(0.0, abs=1e-9)  # where nothing is wanted
    limits = {"voltage": FinLimits.of(12.0, 1e3)}
    mpc = js.Mpc.of(plant, {"speed": 0.1}, limits=limits, rest=at, horizon=0.4, free=4)
    with pytest.raises(InputError, match="mpc: track: names no channel"):
        js.Mpc.of(plant, limits=limits, rest=at)
    reference = jnp.full((mpc.samples, 1), 10.0)

    def sample(carry, _):
        plan, x = carry
        plan, u, _ = mpc.command(plan, x, reference)
        return (plan, plant.step(x, u)), u

    begun = mpc.start(jnp.zeros(1)), plant.start(jnp.zeros(2), jnp.zeros(1))
    (_, x), u = jax.jit(lambda begun: jax.lax.scan(sample, begun, None, 60))(begun)
    np.testing.assert_allclose(x[1], 10.0, rtol=1e-2)
    assert float(jnp.max(jnp.abs(u))) <= 12.0


def test_a_filter_of_a_motor_is_within_its_standard_deviations():
    """Claim: innovations are as large as their deviations, and the current is known to half the sensor's noise."""
    vehicle, _ = driven(CASES["motor"][0], 0.01, 6.0)
    (log,) = runs_of(vehicle, "motor", count=1)
    (clean,) = js.synthetic(vehicle, [log], seed=3, noise=False)
    found = js.estimate_states(vehicle, log)
    white = found.whitened(0)
    assert np.sqrt(np.nanmean(white**2)) == pytest.approx(1.0, abs=0.2)
    error = np.asarray(found.estimates[0].x)[20:, 0] - clean.column("current")[20:]
    assert np.sqrt(np.mean(error**2)) < 0.5 * 0.02


@pytest.mark.long
def test_searches_from_other_guesses_end_at_one_tank():
    """Claim: four starts within half of the hole's size all end at it."""
    vehicle, _ = driven(CASES["tank"][0], 2.0, 2e-3)
    found = js.sweep(vehicle, runs_of(vehicle, "tank"), starts=4, compiled=True)
    (case,) = found.cases
    assert case["success"]["count"] == 4, case["success"]


@pytest.mark.long
def test_a_watched_motor_s_tachometer_that_steps_is_named():
    """Claim: an offset of 5 σ from the middle of a run raises an alarm at that sensor within a second."""
    vehicle, _ = driven(CASES["motor"][0], 0.01, 6.0)
    *clean, log = runs_of(vehicle, "motor", count=3, samples=300)
    shifted = log.column("speed") + np.where(np.arange(300) >= 150, 1.0, 0.0)
    rows = np.column_stack([log.times, log.column("voltage"), log.column("current"), shifted])
    watcher = js.Watcher.of(vehicle, rows[:20], clean, false_alarms_per_hour=1.0, hours=0.5, longest=2.0)
    events = [event for row in rows for event in watcher.step(row) if event["event"] == "alarm"]
    assert [event["place"] for event in events[:1]] == ["sensor:speed"], events
    assert 1.5 <= events[0]["time"] <= 2.5


@pytest.mark.long
def test_a_lag_that_a_tank_lacks_is_named():
    """Claim: a pump that lags by 30 s is named from two runs, with its time constant."""
    vehicle = js.own_model(Gauged(area=0.5, hole=1e-3))
    true = vehicle.with_effect(ActuatorLag("pump", jnp.asarray(30.0)))
    found = js.diagnose(vehicle, runs_of(true, "tank", count=3, samples=250), manoeuvre=False)
    (named,) = found.physics
    assert named.effect == "actuator-lag" and found.verdict == "named"
    assert named.parameters["T"].value == pytest.approx(30.0, rel=0.02)
