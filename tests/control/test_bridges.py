"""What a plant becomes elsewhere is the same plant: in python-control, in CasADi, and in a process without jaxsub."""

import subprocess
import sys

import control
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from control_cases import remembering

from jaxsub.control import (
    casadi_jacobians,
    casadi_plant,
    control_system,
    discretise,
    export_plant,
    export_plant_loader,
    linearise,
    linearise_rates,
    state_space,
)
from jaxsub.errors import InputError
from jaxsub.simulation import at_rest
from jaxsub.vehicle.catalogue import dsrv, nps_auv_ii, remus_100

DT = 0.2
MAKERS = {"nps": nps_auv_ii, "remus": remus_100, "dsrv": dsrv, "remembering": remembering}


@pytest.fixture(
    scope="module", params=[pytest.param(name, marks=[pytest.mark.long] * (name == "remembering")) for name in MAKERS]
)
def plant(request):
    return discretise(MAKERS[request.param](), DT)


@pytest.fixture(scope="module")
def nps():
    return discretise(nps_auv_ii(), DT)


def points(plant, count, seed=2):
    """States, inputs and times at random about the operating speed."""
    rng = np.random.default_rng(seed)
    x = 0.3 * rng.standard_normal((count, len(plant.states)))
    x[:, 0] += 1.5
    return jnp.asarray(x), jnp.asarray(0.2 * rng.standard_normal((count, len(plant.inputs)))), jnp.arange(count) * 0.7


def test_casadi_gives_the_plant_and_its_derivatives(plant):
    x, u, t = points(plant, 20)
    function = casadi_plant(plant)
    linear = casadi_jacobians(function)
    ours = jax.jit(jax.vmap(lambda *at: (plant.step(*at), plant.output(*at), *plant.jacobians(*at))))(x, u, t)
    for k in range(len(t)):
        at = [np.asarray(part[k]) for part in (x, u, t)]
        theirs = [np.asarray(part.full()) for part in (*function(*at), *linear(*at))]
        for found, expected in zip(theirs, ours, strict=True):
            np.testing.assert_allclose(found, np.reshape(expected[k], found.shape), rtol=1e-9, atol=1e-9)


def test_python_control_flies_the_plant(nps):
    system = control_system(nps)
    assert tuple(system.input_labels) == nps.inputs
    assert tuple(system.output_labels) == nps.outputs
    inputs = 0.1 * np.sign(np.random.default_rng(1).standard_normal((30, 3)))
    start = at_rest(nps.vehicle, 1)[0]
    flown = control.input_output_response(system, DT * np.arange(30), inputs.T, np.asarray(start))
    states = jax.jit(lambda x, u: nps.run(x, u))(start, jnp.asarray(inputs))
    np.testing.assert_allclose(flown.states.T, states[:-1], atol=1e-12)
    np.testing.assert_allclose(flown.outputs.T, jax.vmap(nps.output)(states[:-1], jnp.asarray(inputs)), atol=1e-12)


def test_state_space_is_what_python_control_makes_of_the_plant_by_differences(nps):
    start, rest = at_rest(nps.vehicle, 1)[0], jnp.zeros(3)
    ours = state_space(linearise(nps, start, rest))
    theirs = control_system(nps).linearize(np.asarray(start), np.zeros(3), eps=1e-6)
    for part in "ABCD":
        np.testing.assert_allclose(getattr(ours, part), getattr(theirs, part), atol=1e-5)
    assert ours.dt == DT
    continuous = state_space(linearise_rates(nps, start, rest))
    assert continuous.dt == 0.0
    again = continuous.sample(DT)
    np.testing.assert_allclose(again.A, ours.A, atol=1e-4)


WITHOUT = """
import sys
for name in ("jaxsub", "equinox", "optimistix", "diffrax"):
    sys.modules[name] = None
import jax, numpy as np
jax.config.update("jax_enable_x64", True)
sys.path.append({folder!r})
from plant_loader import load
before = list(sys.path)
plant = load({path!r})
assert sys.path == before
x, rows = plant.start, []
for u in np.load({inputs!r}):
    rows.append(np.concatenate([x, plant.output(x, u, 0.4)]))
    x = plant.step(x, u, 0.4)
A, B, C, D = plant.jacobians(x, u)
slope = jax.grad(lambda u: plant.step(x, u)[5])(np.zeros(3))
np.savez({out!r}, rows=np.array(rows), A=A, B=B, slope=slope, states=plant.states)
"""


@pytest.mark.long
def test_exported_plant_runs_where_there_is_only_jax(tmp_path):
    plant = discretise(remembering(), DT)
    path, inputs = tmp_path / "nps.plant", 0.1 * np.sign(np.random.default_rng(1).standard_normal((25, 3)))
    np.save(tmp_path / "inputs.npy", inputs)
    export_plant(plant, path)
    export_plant_loader(tmp_path / "plant_loader.py")
    names = {"folder": str(tmp_path), "path": str(path)}
    names |= {"inputs": str(tmp_path / "inputs.npy"), "out": str(tmp_path / "out.npz")}
    done = subprocess.run(
        [sys.executable, "-I", "-c", WITHOUT.format(**names)], capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    answer = np.load(tmp_path / "out.npz")
    assert tuple(answer["states"]) == plant.states
    step, output = eqx.filter_jit(plant.step), eqx.filter_jit(plant.output)
    x, u, now = plant.start(at_rest(plant.vehicle, 1)[0], jnp.zeros(3)), jnp.zeros(3), jnp.asarray(0.4)
    for row, u in zip(answer["rows"], jnp.asarray(inputs), strict=True):
        np.testing.assert_allclose(row, np.concatenate([x, output(x, u, now)]), rtol=1e-12, atol=1e-12)
        x = step(x, u, now)
    A = eqx.filter_jit(plant.jacobians)(x, u).A
    np.testing.assert_allclose(answer["A"], A, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(answer["slope"], eqx.filter_jit(plant.jacobians)(x, jnp.zeros(3)).B[5], atol=1e-12)


def test_plant_is_exported_to_a_folder_that_is_there(nps, tmp_path):
    with pytest.raises(InputError, match=r"its folder is not there; make it first$"):
        export_plant(nps, tmp_path / "none" / "nps.plant")
