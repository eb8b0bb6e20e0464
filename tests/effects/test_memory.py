"""Forces with a memory follow their own differential equation, dissipate, and are filled in along a stored motion."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from rigs import driven, oscillator, stacked
from samples import BODY, RIG, motion
from scipy.integrate import solve_ivp

from jaxsub.effects import FluidMemory, Hysteresis, admissible, with_memories
from jaxsub.simulation import Sampled, at_rest

RATE = lambda t: 0.4 * np.sin(1.3 * t) + 0.2 * np.cos(3.1 * t)
TIMES = np.concatenate([[0.0], np.cumsum(np.random.default_rng(2).uniform(0.01, 0.03, 300))])


def wen(x_y):
    """Bouc and Wen's equation in its usual form, A = 1, β = γ = ½, n = 1, displacement in units of x_y."""
    return lambda v, z: (v - 0.5 * abs(v) * z - 0.5 * v * abs(z)) / x_y


CASES = [
    (RIG, Hysteresis("x", jnp.asarray(2.0), jnp.asarray(0.05)), "x", wen(0.05), 0.0),
    (BODY, FluidMemory("sway", jnp.asarray(-2.0), jnp.asarray(0.6)), "sway", lambda v, m: (v - m) / 0.6, 0.0),
    (BODY, FluidMemory("surge", jnp.asarray(-2.0), jnp.asarray(0.6)), "surge", lambda v, m: (v - m) / 0.6, 1.2),
]


def ends(known, equation, offset):
    """Two like runs of a motion whose one velocity is RATE beside `offset`, at both ends of every interval."""

    def at(times):
        now = motion(known, count=len(times))
        row = lambda value: jnp.stack([value, value])
        named = lambda table: {name: row(value) for name, value in table.items() if not name.startswith("memory")}
        rates = named(now.rates) | {equation: row(jnp.asarray(RATE(times) + offset))}
        rest = {name: named(getattr(now, name)) for name in ("actuators", "environment", "accelerations")}
        positions = {n: v for n, v in named(now.positions).items() if not n.startswith("hysteresis")}
        return dataclasses.replace(now, rates=rates, positions=positions, time=row(jnp.asarray(times)), **rest)

    return at(TIMES[:-1]), at(TIMES[1:])


@pytest.mark.parametrize(("known", "effect", "equation", "law", "offset"), CASES, ids=["bouc-wen", "sway", "surge"])
def test_memory_along_a_stored_motion_is_the_solution_of_its_equation(known, effect, equation, law, offset):
    start, end = ends(known, equation, offset)
    steps = np.diff(TIMES)[None] * np.array([[1.0], [1.0]])
    steps[1, 200:] = 0.0
    [(before, after)] = with_memories([effect], start, end, steps)
    path = solve_ivp(lambda t, z: law(RATE(t), z), (0.0, TIMES[-1]), [0.0], t_eval=TIMES, rtol=1e-9, atol=1e-11).y[0]
    (state,) = effect.states
    scale = np.abs(path).max()
    assert scale > 0.05
    np.testing.assert_allclose(before.positions[state][0], path[:-1], atol=2e-3 * scale)
    np.testing.assert_allclose(after.positions[state][0], path[1:], atol=2e-3 * scale)
    # what is padded does not move the state
    np.testing.assert_array_equal(after.positions[state][1, 200:], after.positions[state][1, 199])
    np.testing.assert_array_equal(before.positions[state][:, 0], 0.0)


def test_memory_of_a_hull_follows_its_velocity_through_moving_water():
    """Claim: adrift at 0.5 m/s in water that drifts with it, a hull has the memory of one in water at rest."""
    effect = FluidMemory("sway", jnp.asarray(-2.0), jnp.asarray(0.6))
    steps = np.stack([np.diff(TIMES)] * 2)
    drift = {"sway": jnp.full(steps.shape, 0.5)}
    adrift = [dataclasses.replace(one, water=drift) for one in ends(BODY, "sway", 0.5)]
    ((moved, _),) = with_memories([effect], *adrift, steps)
    ((still, _),) = with_memories([effect], *ends(BODY, "sway", 0.0), steps)
    assert np.abs(still.positions["memory_sway"]).max() > 0.05
    np.testing.assert_allclose(moved.positions["memory_sway"], still.positions["memory_sway"], atol=1e-12)


@pytest.mark.parametrize(("known", "effect", "equation", "law", "offset"), CASES, ids=["bouc-wen", "sway", "surge"])
def test_memory_of_the_admissible_sign_takes_power_out_of_a_motion_from_rest(known, effect, equation, law, offset):
    start, end = ends(known, equation, offset)
    [(before, _)] = with_memories([effect], start, end, np.stack([np.diff(TIMES)] * 2))
    force = np.asarray(effect.force(before)[equation])[0]
    work = np.cumsum(force * RATE(TIMES[:-1]) * np.diff(TIMES))
    sizes = {"F_h": 2.0, "x_y": 1.0} if equation == "x" else {"c": -2.0, "T_m": 1.0}
    assert admissible(effect, sizes)
    assert not admissible(effect, {name: -value if name in ("F_h", "c") else value for name, value in sizes.items()})
    assert work[-1] < 0.0
    # a spring of the memory may give back what it took, and no more
    assert work.max() < 1e-3 * abs(work[-1])


def test_a_simulated_rig_with_hysteresis_follows_bouc_and_wen():
    """Against SciPy on the whole system; the input is held between samples."""
    vehicle = oscillator().with_effect(Hysteresis("x", jnp.asarray(1.5), jnp.asarray(0.05)))
    assert vehicle.layout.positions == ("x", "hysteresis_x")
    times = 0.02 * np.arange(151)
    recording = driven(vehicle, times, seed=3, amplitude=1.0, hold=30)
    runs = stacked(vehicle, [recording])
    states = np.asarray(Sampled.of(vehicle, runs).states(runs, at_rest(vehicle, 1)))[0]
    drive, law = recording.column("f"), wen(0.05)
    state, expected = np.zeros(3), [np.zeros(3)]
    for k in range(150):
        rate = lambda t, y, k=k: [
            2.0 * drive[k] - 0.6 * y[0] - 4.0 * y[1] - 1.5 * y[2], y[0], law(y[0], y[2])
        ]  # fmt: skip
        state = solve_ivp(rate, (0.0, 0.02), state, rtol=1e-8, atol=1e-10).y[:, -1]
        expected.append(state)
    expected = np.array(expected)
    assert 0.8 < np.abs(expected[:, 2]).max() <= 1.0
    np.testing.assert_allclose(states, expected, atol=2e-4)
