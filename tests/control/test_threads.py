"""What threads may share gives each of them the numbers that it gives a caller alone, to the last bit."""

import shutil
from concurrent.futures import ThreadPoolExecutor

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from threads import THREADS, same_in_threads

from jaxsub.control import (
    Mpc,
    casadi_plant,
    control_system,
    discretise,
    export_plant,
    load_plant,
    observer,
    require_trim,
    trim,
)
from jaxsub.control.observers import Drive
from jaxsub.filter import Sample, on_line
from jaxsub.symbolic import compiled
from jaxsub.vehicle.catalogue import nps_auv_ii


@pytest.fixture(scope="module")
def plant():
    return discretise(nps_auv_ii(), 0.2)


def points(plant, count, seed=2):
    rng = np.random.default_rng(seed)
    x = 0.3 * rng.standard_normal((count, len(plant.states)))
    x[:, 0] += 1.5
    return list(zip(x, 0.2 * rng.standard_normal((count, len(plant.inputs))), strict=True))


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
def test_compiled_plant(plant):
    native = compiled(casadi_plant(plant))

    def step(x, u):
        native.given[0][:], native.given[1][:], native.given[2][:] = x, u, 0.0
        native()
        return [part.copy() for part in native.found]

    same_in_threads(step, points(plant, 100), rounds=20)


def test_casadi_function(plant):
    function = casadi_plant(plant)
    same_in_threads(lambda x, u: [part.full() for part in function(x, u, 0.0)], points(plant, 100), rounds=5)


def test_python_control_system(plant):
    system = control_system(plant)
    call = lambda x, u: (system.dynamics(0.0, x, u), system.output(0.0, x, u))
    same_in_threads(call, points(plant, 40), rounds=3)


def test_exported_plant(plant, tmp_path):
    """Compiled by whichever thread calls first."""
    export_plant(plant, tmp_path / "nps.plant")
    loaded, first = load_plant(tmp_path / "nps.plant"), load_plant(tmp_path / "nps.plant")
    at = points(plant, 40)
    expected = [np.asarray(first.step(*pair)) for pair in at]
    with ThreadPoolExecutor(THREADS) as pool:
        for found, wanted in zip(pool.map(lambda pair: loaded.step(*pair), at), expected, strict=True):
            np.testing.assert_array_equal(found, wanted)
    same_in_threads(lambda x, u: (loaded.step(x, u), loaded.output(x, u)), at, rounds=3)


def test_observer(plant):
    """Each thread has a state of its own, which goes from call to call."""
    filter = observer(plant, jnp.full(len(plant.outputs), 0.01))
    step, level = on_line(filter), require_trim(plant, trim(plant))

    def track(seed):
        rng = np.random.default_rng(int(seed))
        state, found = filter.start(level.x, jnp.zeros(0), jnp.zeros((0, 0))), []
        for k in range(30):
            u = jnp.asarray(0.1 * rng.standard_normal(3))
            y = jnp.asarray(np.asarray(level.x) + 0.01 * rng.standard_normal(len(plant.outputs)))
            drive = Drive(u, u, jnp.asarray(0.2 * k))
            state, seen = step(state, Sample(drive, jnp.asarray(0.2), y, jnp.ones(y.shape, bool)))
            found.append(np.asarray(seen.x))
        return found

    same_in_threads(track, [(seed,) for seed in range(THREADS)])


@pytest.mark.long
def test_predictive_controller(plant):
    controller = Mpc.of(plant, horizon=5.0, free=4)
    reference = jnp.zeros((controller.samples, 2)).at[:, 0].set(1.0)
    command = eqx.filter_jit(lambda plan, x: controller.command(plan, x, reference))

    def call(x, u):
        plan, given, _ = command(controller.start(jnp.zeros(3)), jnp.asarray(x) * 0.1)
        return plan.nodes, given

    same_in_threads(call, points(plant, 8))
