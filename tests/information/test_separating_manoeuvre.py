"""A designed manoeuvre separates rivals by what it promises, more than the recorded inputs, and inside their limits."""

import functools
import tomllib

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from rigs import driven, oscillator

from jaxsub.cli import simulate as simulate_command
from jaxsub.effects import VOCABULARY, with_numbers
from jaxsub.errors import InputError
from jaxsub.estimate import batch, search
from jaxsub.information.design_limits import Bounds, ManoeuvreLimits
from jaxsub.information.design_search import descend
from jaxsub.information.separating_manoeuvre import recorded_limits, separating_manoeuvre
from jaxsub.information.separation import Rivals, loss
from jaxsub.recording import Recording, load, save
from jaxsub.simulation import prbs, sampled_states, simulate, synthetic
from jaxsub.vehicle import vehicle_from, vehicle_text, write_vehicle
from jaxsub.vehicle.catalogue import dsrv

SAMPLES, INTERVAL = 61, 0.2
TIMES = INTERVAL * np.arange(SAMPLES)
SIGMA = np.array([0.01, 0.02])


def effect(name, numbers, **options):
    return with_numbers(next(kind for kind in VOCABULARY if kind.name == name)(**options), numbers)


def drags(vehicle, equation, quadratic, cubic):
    return [
        vehicle.with_effect(effect("quadratic-damping", {"coefficient": quadratic}, equation=equation)),
        vehicle.with_effect(effect("cubic-damping", {"coefficient": cubic}, equation=equation)),
    ]


def recorded(truth, column, signal, seed=0):
    blank = Recording("run", TIMES, {column: signal}, "run")
    return synthetic(truth, [blank], seed=seed, states=sampled_states)[0]


RIVALS = drags(oscillator(), "x", -0.5, -0.4)


@functools.cache
def weak():
    """A run that hardly separates the two."""
    return recorded(RIVALS[0], "f", np.sin(1.6 * TIMES))


def on(models, like, inputs, sigma):
    """The rivals on a run with the inputs and the start of `like`."""
    run = batch(models[0], [like])
    limits = recorded_limits(models[0], like)
    bounds = Bounds.of(models[0], limits, like.times, inputs[0])
    return Rivals.of(models, run, run, jnp.asarray(sigma), bounds, jnp.asarray(inputs))


def separation_by_differences(truth, rival, start, spread, run, sigma):
    """Both simulated, the rival's numbers and initial state moved one by one, and the linear problem by SciPy's QR."""
    shown = eqx.filter_jit(lambda vehicle, start: simulate(vehicle, run, start)[0] / sigma)
    values = {row.name: float(rival.values()[row.name]) for row in rival.layout.free}
    columns, known = [], []
    for name, value in values.items():
        step = 1e-5 * abs(value)
        pair = [np.asarray(shown(rival.with_values({name: jnp.asarray(value + h)}), start)) for h in (step, -step)]
        # by their own sizes: least squares that knows nothing of units needs columns of like length
        columns.append((pair[0] - pair[1]).ravel() / 2e-5)
        known.append(0.0)
    for i, size in enumerate(np.asarray(spread)):
        pair = [np.asarray(shown(rival, start.at[0, i].add(h))) for h in (1e-5, -1e-5)]
        columns.append((pair[0] - pair[1]).ravel() / 2e-5)
        known.append(1.0 / size)
    apart = (np.asarray(shown(truth, start)) - np.asarray(shown(rival, start))).ravel()
    S = np.concatenate([np.stack(columns, 1), np.diag(known)])
    padded = np.concatenate([apart, np.zeros(len(known))])
    change = np.linalg.lstsq(S, padded, rcond=None)[0]
    return np.sum((padded - S @ change) ** 2)


@pytest.mark.parametrize("body", [False, pytest.param(True, marks=pytest.mark.long)], ids=["oscillator", "DSRV"])
def test_separation_is_that_of_central_differences_and_least_squares(body):
    models, column = (drags(dsrv(), "pitch", -2e4, -1e5), "delta_s") if body else (RIVALS, "f")
    like = recorded(models[0], column, prbs(SAMPLES, 9, 0.1 if body else 1.0, 1))
    sigma = np.array([output.sigma for output in models[0].layout.outputs])
    inputs = prbs(SAMPLES, 5, 0.3 if body else 2.0, 2)[:, None]
    rivals = on(models, like, inputs, sigma)
    found = np.asarray(eqx.filter_jit(rivals.separations)(jnp.asarray(inputs)))
    for truth, rival in ((0, 1), (1, 0)):
        run, start = rivals.driven(jnp.asarray(inputs)), rivals.starts[rival]
        expected = separation_by_differences(models[truth], models[rival], start, rivals.spreads[rival], run, sigma)
        np.testing.assert_allclose(found[truth, rival], expected, rtol=1e-4)
    assert np.all(np.isinf(np.diag(found)))


@pytest.mark.long
def test_gradient_of_the_search_is_that_of_central_differences():
    rivals = on(RIVALS, weak(), np.zeros((SAMPLES, 1)), SIGMA)
    both = eqx.filter_jit(jax.value_and_grad(lambda free: loss(free, rivals)))
    rng = np.random.default_rng(0)
    # large enough that channels leave their limits and the penalty counts
    free = jnp.asarray(3.0 * rng.standard_normal((SAMPLES, 1)))
    gradient = both(free)[1]
    for way in rng.standard_normal((4, SAMPLES, 1)):
        difference = (both(free + 1e-5 * way)[0] - both(free - 1e-5 * way)[0]) / 2e-5
        np.testing.assert_allclose(np.sum(gradient * way), difference, rtol=1e-4)


@pytest.fixture(scope="module")
def found():
    return separating_manoeuvre(RIVALS, weak(), SIGMA, duration=10.0, interval=0.25, steps=30)


@pytest.mark.long
def test_designed_inputs_separate_as_much_as_a_refit_says_and_more_than_every_start(found):
    np.testing.assert_allclose(found.recording.times, 0.25 * np.arange(41))
    assert found.separation == np.min(found.pairs) > 3.0 * found.before
    assert found.separation >= max(found.tried.values())
    assert found.before == found.tried["recorded inputs"] == np.min(found.pairs_before)
    truth, rival = np.unravel_index(np.argmin(found.pairs), found.pairs.shape)
    start = jnp.asarray([[weak().column("x_rate")[0], weak().column("x")[0]]])
    (answer,) = synthetic(RIVALS[truth], [found.recording], seed=0, noise=False, start=start, states=sampled_states)
    missed = 2.0 * float(search(RIVALS[rival], batch(RIVALS[rival], [answer]), sigma=jnp.asarray(SIGMA)).cost)
    # the expectation is linear in the change of the rival's numbers, the refit is not
    np.testing.assert_allclose(missed, found.separation, rtol=0.25)


@pytest.mark.long
def test_designed_inputs_keep_what_the_recordings_used(found):
    inputs, used = found.recording.column("f"), weak().column("f")
    assert used.min() * (1 + 1e-9) <= inputs.min() and inputs.max() <= used.max() * (1 + 1e-9)
    assert np.max(np.abs(np.diff(inputs))) / 0.25 <= np.max(np.abs(np.diff(used))) / INTERVAL * (1 + 1e-9)
    assert found.within <= 1.0
    kept = recorded_limits(RIVALS[0], weak()).channels["x"]
    assert isinstance(kept, tuple)
    low, high = kept
    (answer,) = synthetic(RIVALS[0], [found.recording], seed=0, noise=False, states=sampled_states)
    assert low - 0.05 < answer.column("x").min() and answer.column("x").max() < high + 0.05


def test_a_body_keeps_its_attitude_however_that_is_described():
    """Claim: by a quaternion the limits of roll, pitch and depth are those by Euler angles, of the same run."""
    text = vehicle_text(dsrv())
    assert "attitude" not in text
    turned = text.replace("[coefficients]", '[model]\nattitude = "quaternion"\n\n[coefficients]', 1)
    told = [vehicle_from(tomllib.loads(one), "dsrv.toml") for one in (text, turned)]
    run = driven(told[0], TIMES, seed=3)
    plain, same = (recorded_limits(vehicle, run).channels for vehicle in told)
    assert "theta" in plain and {*plain} <= {*same}
    for name, limits in plain.items():
        np.testing.assert_allclose(same[name], limits, atol=1e-6)


def test_limits_whose_sides_differ_are_kept_from_where_the_actuator_began():
    limits = ManoeuvreLimits({"f": (-0.2, 0.5)}, {"f": 1.0})
    bounds = Bounds.of(RIVALS[0], limits, TIMES, np.array([0.4]))
    wanted = 3.0 * np.random.default_rng(0).standard_normal((SAMPLES, 1))
    for inputs in (np.asarray(bounds.inputs(jnp.asarray(wanted))), np.asarray(bounds.follow(jnp.asarray(wanted)))):
        assert inputs.min() >= -0.2 - 1e-12 and inputs.max() <= 0.5 + 1e-12
        assert np.max(np.abs(np.diff(inputs[:, 0], prepend=0.4))) <= INTERVAL * (1 + 1e-12)
    inside = np.clip(wanted, -0.1, 0.4)
    assert np.corrcoef(bounds.free(jnp.asarray(inside))[:, 0], inside[:, 0])[0, 1] > 0.95


@pytest.mark.long
def test_command_line_simulates_the_designed_inputs_from_where_the_recording_began(found, tmp_path):
    write_vehicle(RIVALS[0], tmp_path / "vehicle.toml")
    save(found.recording, tmp_path / "next.csv")
    simulate_command.run(tmp_path / "vehicle.toml", tmp_path / "next.csv", tmp_path / "answer.csv", False)
    answer = load(tmp_path / "answer.csv")
    np.testing.assert_allclose(answer.column("f"), found.recording.column("f"))
    np.testing.assert_allclose(answer.column("x")[0], weak().column("x")[0])
    assert np.all(np.isfinite(answer.column("x")))


def test_every_start_of_the_search_finds_the_bottom_of_a_bowl():
    centre = np.random.default_rng(0).standard_normal((7, 2))
    bowl = lambda free, args: jnp.sum(jnp.arange(1.0, 8.0)[:, None] * (free - args) ** 2)
    begin = jnp.asarray(np.random.default_rng(1).standard_normal((3, 7, 2)))
    ends, history = descend(bowl, begin, jnp.asarray(centre), 80)
    np.testing.assert_allclose(ends, np.broadcast_to(centre, (3, 7, 2)), atol=1e-3)
    for line in np.asarray(history):
        done = line[np.isfinite(line)]
        assert len(done) < 80 and np.all(np.diff(done) <= 0.0)


@pytest.mark.parametrize(
    ("models", "named"),
    [
        (RIVALS[:1], "1 was given"),
        ([RIVALS[0], oscillator(outputs={"x": {"sigma": 0.01}})], "different vehicles"),
    ],
)
def test_rivals_that_cannot_be_compared_are_refused(models, named):
    with pytest.raises(InputError, match=named):
        separating_manoeuvre(models, weak(), SIGMA)
