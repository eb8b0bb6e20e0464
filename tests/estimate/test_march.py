"""A problem on compiled C says what the same problem says by JAX, whatever stands beside it in a batch."""

import dataclasses
import shutil

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from rigs import body, chosen, coupled, driven, oscillator, stacked
from threads import same_in_threads

from jaxsub.effects import AbstractActuator, parameter_table
from jaxsub.errors import InputError
from jaxsub.estimate import Problem, gauss_newton, scattered
from jaxsub.estimate.problem import Expansion
from jaxsub.simulation import simulate, synthetic
from jaxsub.vehicle import vehicle_from

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
SIGMA = 0.02


def problem(vehicle, lengths=(40, 25), substeps=1, known_start=False, **options):
    """The fit of a vehicle a few per cent off to runs of those lengths, some of whose samples are missing."""
    driving = [driven(vehicle, 0.1 * np.arange(n), seed=i, **options) for i, n in enumerate(lengths)]
    runs = stacked(vehicle, synthetic(vehicle, driving, seed=4), substeps)
    kept = jnp.asarray(np.random.default_rng(6).uniform(size=runs.mask.shape) < 0.8) & runs.mask
    runs = dataclasses.replace(runs, mask=kept, outputs=jnp.where(kept, runs.outputs, 0.0))
    sigma = jnp.full(runs.outputs.shape[-1], SIGMA)
    return Problem.of(vehicle, runs, sigma, known_start=known_start)


def turning(made):
    """A problem whose heading is measured many turns on, as is the guess in the second run."""
    layout = made.vehicle.layout
    heading, state = layout.channels.index("psi"), layout.states.index("psi")
    assert made.runs.counted[heading]
    more = 2.0 * jnp.pi * jnp.array([[1.0], [0.0]]) + jnp.linspace(0.0, 20.0, made.runs.times.shape[1])
    outputs = jnp.where(made.runs.mask, made.runs.outputs.at[..., heading].add(more), 0.0)
    guess = made.guess.at[1, state].add(-4.0 * jnp.pi)
    return dataclasses.replace(made, runs=dataclasses.replace(made.runs, outputs=outputs), guess=guess)


FEW = ("quadratic-damping", "fluid-memory", "current", "sensor-scale")


def laden(names=None):
    """A body with effects, of those names or every one of the vocabulary that there is C for."""
    vehicle = body()
    for effect in chosen(vehicle):
        there = not isinstance(effect, AbstractActuator) and effect.name != "sensor-delay"
        if there and (names is None or effect.name in names):
            vehicle = vehicle.with_effect(effect)
    return vehicle


def nonlinear():
    """A hull with products of velocities, fins and absolute values, Coriolis in full and a recorded current."""
    products = {"Y_uv": -40.0, "Y_v|v|": -30.0, "N_vvr": -2.0, "K_p|p|": -2.0, "N_uu_delta_r": -7.0, "Y_|r|v": 1.0}
    linear = {"Y_vdot": -60.0, "N_rdot": -20.0, "N_r": -20.0, "K_p": -1.0, "Y_rdot": 2.0}
    return vehicle_from(
        {
            "schema": 1, "name": "hull", "kind": "submerged-body", "dof": ["sway", "roll", "yaw"],
            "body": {"mass": 60.0, "inertia": [1.0, 12.0, 12.0], "speed": 1.5, "centre_of_gravity": [0.0, 0.0, 0.02]},
            "model": {"coriolis": "full"}, "coefficients": linear | products, "inputs": {"rudder": "dr"},
            "environment": {"current_north": "V"}, "outputs": {name: {"sigma": 0.01} for name in ("v", "p", "r")},
        },
        "hull.toml",
    )  # fmt: skip


def raw():
    """A hull whose raw channels have arms, mountings, scales and offsets, some of them free."""
    free = lambda value: {"value": value, "free": True}
    placed = {"sigma": SIGMA, "lever_arm": [0.4, -0.1, 0.2], "mounting": [0.1, 0.0, free(0.05)]}
    return vehicle_from(
        {
            "schema": 1, "name": "hull", "kind": "submerged-body", "dof": ["sway", "roll", "yaw"],
            "body": {"mass": 60.0, "inertia": [1.0, 12.0, 12.0], "speed": 1.5, "centre_of_gravity": [0.0, 0.0, 0.02]},
            "coefficients": {"Y_v": -40.0, "N_r": -20.0, "K_p": -1.0, "N_delta_r": -5.0},
            "inputs": {"rudder": {"column": "dr", "scale": -1.0, "offset": 0.02}},
            "prescribed": {"theta": {"column": "pitch", "offset": 0.1}},
            "outputs": {
                "dvl": placed | {"channel": ["u", "v", "w"], "frame": "FLU"},
                "acc": placed | {"channel": ["ax", "ay", "az"], "offset": free(0.1)},
                "log": placed | {"channel": "beam", "directions": [[1, 0, 1], [0, 1, 1]], "column": ["b", "c"]},
                "gps": {"channel": ["latitude", "longitude"], "origin": [0.0, 0.0], "scale": 6e6},
                "cell": {"channel": "pressure", "latitude": 0.8, "scale": 1e-4, "offset": free(0.3)},
                "compass": {"channel": "psi", "frame": "ENU", "offset": 0.3},
            },
        },
        "hull.toml",
    )  # fmt: skip


CASES = {
    "raw channels": lambda: problem(raw(), lengths=(6, 5), amplitude=0.1),
    "derivatives": lambda: problem(nonlinear(), lengths=(6, 5), amplitude=0.1),
    "mechanism": lambda: problem(coupled(), substeps=2),
    "known start": lambda: problem(coupled(), known_start=True),
    "body": lambda: problem(laden(FEW), lengths=(6, 5), amplitude=0.02),
    "turns": lambda: turning(problem(body(), lengths=(30, 20), amplitude=0.3)),
    "every effect": lambda: problem(laden(), lengths=(6, 5), amplitude=0.02),
}
LONG = ("turns", "every effect", "raw channels", "derivatives", "known start", "body")
PARAMS = [pytest.param(case, marks=[pytest.mark.long] * (case in LONG)) for case in CASES]


@pytest.fixture(scope="module", params=PARAMS)
def both(request):
    """A problem, the same on C, and points about its start."""
    made = CASES[request.param]()
    y = made.coordinates() + 0.02 * jnp.asarray(np.random.default_rng(2).normal(size=(11, made.coordinates().size)))
    return made, made.in_c(), y


def close(found, expected):
    """Each to 1e-11 of its largest number; a gradient Jᵀr, what is left of larger terms, to 1e-11 of |J| |r|."""
    for one, other in zip(jax.tree.leaves(found), jax.tree.leaves(expected), strict=True):
        size = jnp.abs(other)
        if isinstance(expected, Expansion) and other is expected.gradient:
            curved = lambda of: jnp.diag(of.hessian)
            diagonal = jax.vmap(curved)(expected) if expected.cost.ndim else curved(expected)
            size = jnp.sqrt(2.0 * expected.cost[..., None] * diagonal)
        np.testing.assert_allclose(one, other, rtol=0.0, atol=1e-11 * float(jnp.max(size)))


def test_cost_and_expansion_are_those_of_jax(both):
    made, fast, y = both
    few = y[:3]
    close(jax.jit(jax.vmap(fast.cost))(few), jax.jit(jax.vmap(made.cost))(few))
    close(jax.jit(jax.vmap(fast.expand))(few), jax.jit(jax.vmap(made.expand))(few))


@pytest.mark.parametrize("count", [1, 11])
def test_a_member_says_the_same_whoever_is_beside_it(both, count):
    """To the last digit but one: lanes are filled with members, or where those are few with their runs."""
    _, fast, y = both
    close(jax.jit(jax.vmap(fast.expand))(y[:count]), jax.lax.map(fast.expand, y[:count]))


@pytest.mark.long
def test_batches_of_batches_and_recordings_of_their_own():
    made = problem(coupled())
    fast = made.in_c()
    y = made.coordinates() + 0.02 * jnp.asarray(np.random.default_rng(2).normal(size=(2, 3, made.coordinates().size)))
    outputs = made.runs.outputs + jnp.asarray(np.random.default_rng(3).normal(size=(3, *made.runs.outputs.shape)))

    def cost(of, y, outputs):
        return dataclasses.replace(of, runs=dataclasses.replace(of.runs, outputs=outputs)).cost(y)

    for over_outputs in (None, 0):
        batched = lambda of, axis=over_outputs: jax.vmap(jax.vmap(lambda y, z: cost(of, y, z), (0, axis)), (0, None))(
            y, outputs[0] if axis is None else outputs
        )
        close(batched(fast), batched(made))


def test_threads_find_what_one_finds_alone():
    """Claim: one compiled march gives each of several threads the cost and expansion at its own coordinates."""
    fast = problem(coupled()).in_c()
    steps = np.random.default_rng(7).normal(size=(12, fast.coordinates().size))
    y = [(fast.coordinates() + 0.02 * step,) for step in steps]
    of = jax.jit(lambda y: (fast.cost(y), *jax.tree.leaves(fast.expand(y)))).lower(*y[0]).compile()
    same_in_threads(of, y, rounds=20)


def test_a_run_that_ended_may_go_anywhere_afterwards():
    """Drag that drives blows up from a start that is fast enough, where the shorter run is made up to the longer."""
    drag = next(e for e in chosen(oscillator()) if e.name == "quadratic-damping")
    vehicle = oscillator().with_effect(drag)
    made = problem(vehicle.with_values({row.name: jnp.asarray(0.5) for row in parameter_table(drag).values()}), (60, 4))
    made = dataclasses.replace(made, guess=made.guess.at[1].set(jnp.array([4.0, 0.0])))
    fast, y = made.in_c(), made.coordinates()
    longer = dataclasses.replace(made.runs, live=jnp.ones_like(made.runs.live))
    assert not np.isfinite(simulate(made.split(y)[0], longer, made.guess)).all()
    close(fast.expand(y), made.expand(y))


@pytest.mark.long
def test_searches_end_where_they_end_by_jax():
    made = problem(coupled())
    starts = scattered(made, 0.3, 12, 0)
    found, expected = (gauss_newton().run(of, starts) for of in (made.in_c(), made))
    np.testing.assert_array_equal(found.evaluations, expected.evaluations)
    np.testing.assert_allclose(found.y, expected.y, rtol=1e-7, atol=1e-7)


def test_what_has_no_c_is_refused():
    uneven = problem(oscillator())
    uneven = dataclasses.replace(uneven, runs=dataclasses.replace(uneven.runs, steps=jnp.array([0.1, 0.2])))
    with pytest.raises(InputError, match="unevenly"):
        uneven.in_c()
    effects = {effect.name: effect for effect in chosen(oscillator())}
    for name, why in {"actuator-lag": "actuators: answer to what is estimated", "sensor-delay": "more than"}.items():
        with pytest.raises(InputError, match=why):
            problem(oscillator().with_effect(effects[name]), lengths=(8,), hold=2).in_c()
