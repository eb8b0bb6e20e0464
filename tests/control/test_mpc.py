"""A plan is the optimum that IPOPT finds, keeps its limits whenever it is cut short, and steers what it is flown on."""

import casadi
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxsub.control import FinLimits, Mpc, casadi_plant, discretise, observer, pursue
from jaxsub.control.mpc_problem import spread
from jaxsub.control.observers import Drive
from jaxsub.effects import ActuatorLag
from jaxsub.errors import InputError
from jaxsub.filter import Sample
from jaxsub.parameters import number
from jaxsub.simulation import at_rest
from jaxsub.vehicle.catalogue import nps_auv_ii

DT, LIMITS, WITHIN = 0.2, FinLimits.of(0.3, 0.25), {"theta": (-0.12, 0.12), "z": (-1.0, 2.5)}
REST = jnp.zeros(3)


@pytest.fixture(scope="module")
def plant():
    return discretise(nps_auv_ii(), DT)


@pytest.fixture(scope="module")
def mpc(plant):
    return Mpc.of(plant, within=WITHIN, limits=LIMITS, horizon=8.0, free=6, tolerance=1e-10, steps=40)


@pytest.fixture(scope="module")
def hard(plant, mpc):
    """Deeper than pitch and depth allow, and a turn at the rudder's limits."""
    x = plant.start(at_rest(plant.vehicle, 1)[0], REST)
    return mpc.task(mpc.start(REST), x, jnp.tile(jnp.array([4.0, 0.8]), (mpc.samples, 1)))


def test_plan_is_the_optimum_that_ipopt_finds(plant, mpc, hard):
    y, solved = eqx.filter_jit(mpc.solve)(hard, jnp.zeros(18))
    step, weights = casadi_plant(plant), mpc.weights
    nodes = casadi.MX.sym("nodes", 3, len(mpc.nodes))
    inputs = nodes @ casadi.DM(np.asarray(spread(mpc.nodes))).T
    x, before, cost, soft = casadi.DM(np.asarray(hard.x)), casadi.DM.zeros(3), 0.0, []
    z, psi, theta = (plant.states.index(n) for n in ("z", "psi", "theta"))
    for k in range(mpc.samples):
        u = inputs[:, k]
        x = step(x, u, 0.0)[0]
        cost += 0.5 * DT * (((x[z] - 4.0) / 0.5) ** 2 + (2.0 * casadi.sin(0.5 * (x[psi] - 0.8)) / 0.09) ** 2)
        cost += 0.5 * DT * casadi.sumsqr((u - np.asarray(weights.rest)) / (0.5 * 0.3))
        cost += 0.5 * DT * casadi.sumsqr((u - before) / DT / (0.5 * 0.25))
        before = u
        for value, (low, high) in ((x[theta], WITHIN["theta"]), (x[z], WITHIN["z"])):
            soft += [(value - high) / (0.5 * (high - low)), (low - value) / (0.5 * (high - low))]
    past = casadi.MX.sym("past", len(soft))
    cost += 0.5 * casadi.sumsqr(past) / 1e-4
    gaps = np.diff(mpc.nodes, prepend=-1)
    turned = casadi.horzcat(nodes[:, :1], nodes[:, 1:] - nodes[:, :-1]) / (
        0.25 * DT * casadi.repmat(casadi.DM(gaps).T, 3, 1)
    )
    problem = {
        "x": casadi.veccat(nodes, past),
        "f": cost,
        "g": casadi.vertcat(casadi.vec(nodes) / 0.3, casadi.vec(turned), casadi.vertcat(*soft) - past),
    }
    solver = casadi.nlpsol("peer", "ipopt", problem, {"print_time": False, "ipopt": {"print_level": 0, "tol": 1e-10}})
    hard_rows = 36
    low = np.concatenate([-np.ones(hard_rows), np.full(len(soft), -np.inf)])
    high = np.concatenate([np.ones(hard_rows), np.zeros(len(soft))])
    found = solver(x0=0.0, lbg=low, ubg=high, lbx=[-np.inf] * 18 + [0.0] * len(soft), ubx=np.inf)
    assert solver.stats()["success"]
    assert float(solved.cost) == pytest.approx(float(found["f"]), rel=1e-6)
    peer = np.asarray(found["x"])[:18].reshape(len(mpc.nodes), 3)
    np.testing.assert_allclose(y.reshape(-1, 3) * 0.3, peer, atol=2e-4)
    assert np.abs(peer).max() == pytest.approx(0.3, rel=1e-4)  # limits are active


@pytest.mark.parametrize("most", [pytest.param(1, marks=pytest.mark.long), 2])
def test_plan_that_is_cut_short_keeps_the_limits_of_its_inputs(mpc, hard, most):
    short = Mpc(mpc.plant, mpc.weights, mpc.nodes, 0.0, most)
    y, solved = eqx.filter_jit(short.solve)(hard, jnp.zeros(18))
    assert float(solved.passed[0]) < 1e-7
    assert float(solved.promised) > 0.0
    assert float(hard.cost(y)) < float(hard.cost(jnp.zeros(18)))


def test_one_program_serves_every_sample_and_bad_states_are_values(mpc, plant):
    traced = []

    @jax.jit
    def command(plan, x, reference, now):
        traced.append(1)
        return mpc.command(plan, x, reference, now)

    plan, x = mpc.start(REST), plant.start(at_rest(plant.vehicle, 1)[0], REST)
    reference = jnp.tile(jnp.array([1.0, 0.3]), (mpc.samples, 1))
    for k in range(4):
        plan, u, solved = command(plan, x + 0.01 * k, (1.0 + k) * reference, jnp.asarray(DT * k))
        assert bool(solved.finite)
    after, given, solved = command(plan, x * jnp.nan, reference, jnp.asarray(1.0))
    assert not bool(solved.finite)
    np.testing.assert_array_equal(given, u)
    assert bool(jnp.all(jnp.isfinite(after.nodes)))
    assert len(traced) == 1


@pytest.fixture(scope="module")
def lagging():
    return discretise(nps_auv_ii().with_effect(ActuatorLag("rudder", number(1.5))), DT)


@pytest.mark.long
def test_flight_keeps_limits_and_a_model_with_the_lag_steers_better(lagging, plant):
    t = DT * np.arange(120)
    wanted = {"z": np.where(t < 2.0, 0.0, 3.0), "psi": 0.5 * np.sin(2.0 * np.pi * t / 24.0)}
    options = {"within": {"theta": (-0.12, 0.12)}, "limits": LIMITS, "horizon": 8.0, "free": 6}
    flown = {
        name: pursue(lagging, Mpc.of(of, **options), wanted, seed=1) for name, of in (("not", plant), ("own", lagging))
    }
    error = {name: np.sqrt(np.mean((f.truth["psi"] - f.wanted[:, 1])[40:] ** 2)) for name, f in flown.items()}
    assert error["own"] < 0.7 * error["not"]
    for flight in flown.values():
        assert np.abs(flight.inputs).max() <= 0.3 + 1e-12
        assert np.abs(np.diff(flight.inputs, axis=0)).max() <= 0.25 * DT + 1e-12
    own = flown["own"]
    assert np.abs(own.truth["theta"]).max() < 0.135  # 0.12, and what noise does to the estimate
    assert own.truth["z"][-1] > 1.0
    assert own.solved.finite.all()
    assert len(own.recording.times) == 120


def test_observer_knows_the_depth_better_than_its_sensor(lagging):
    sigma = jnp.asarray([output.sigma for output in lagging.vehicle.layout.outputs])
    follower = observer(lagging, sigma)
    x = lagging.start(at_rest(lagging.vehicle, 1)[0], REST)
    state = follower.start(x, jnp.zeros(0), jnp.zeros((0, 0)))
    draws = sigma * np.random.default_rng(3).standard_normal((150, len(sigma)))
    inputs = jnp.asarray(0.1 * np.sign(np.sin(0.3 * np.arange(150)))[:, None] * np.ones(3))

    def on(carry, part):
        x, state = carry
        k, u, noise = part
        now = DT * k
        x = lagging.step(x, u, now - DT)
        sample = Sample(
            Drive(u, u, now), jnp.asarray(DT), lagging.output(x, u, now) + noise, jnp.ones(len(sigma), bool)
        )
        state, _ = follower.step(state, sample)
        return (x, state), (x, state.x)

    times = jnp.arange(1.0, 151.0)
    _, (true, known) = jax.jit(lambda: jax.lax.scan(on, (x, state), (times, inputs, jnp.asarray(draws))))()
    z, held = (lagging.states.index(name) for name in ("z", "rudder_held_0"))
    assert float(jnp.std((known - true)[50:, z])) < 0.6 * 0.05
    np.testing.assert_allclose(known[:, held], true[:, held], atol=1e-12)


def test_controller_of_what_is_not_there_is_refused(plant, mpc):
    with pytest.raises(InputError, match=r"^mpc: channel 'heading': .*did you mean 'heading_rate'\?$"):
        Mpc.of(plant, {"heading": 0.1})
    with pytest.raises(InputError, match=r"^mpc: within 'theta': 1 to 0 is empty"):
        Mpc.of(plant, within={"theta": (1.0, 0.0)})
    with pytest.raises(InputError, match=r"^NPS AUV II: input 'rudder': has no finite limits of amplitude and rate"):
        Mpc.of(plant, limits=FinLimits.of(0.3, np.inf))
    with pytest.raises(InputError, match=r"references: the controller tracks z, psi; give one of each"):
        pursue(plant, mpc, {"z": np.zeros(5)}, seed=1)
