"""Models of a user's own: a motor, a tank and a double pendulum, from Python and from a file."""

from typing import ClassVar

import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array
from rigs import stacked
from scipy.integrate import solve_ivp

import jaxsub as js
from jaxsub.control import discretise, linearise_rates
from jaxsub.errors import InputError
from jaxsub.estimate import Problem, gauss_newton
from jaxsub.simulation import prbs, simulate, synthetic


class Motor(js.Model):
    """A brushed motor: its current and its speed."""

    states, inputs, outputs = ("current", "speed"), ("voltage",), {"current": 0.02, "speed": 0.2}
    R: Array
    L: Array
    k: Array
    J: Array
    d: Array

    def rates(self, state, inputs, time):
        i, w = state["current"], state["speed"]
        return {
            "current": (inputs["voltage"] - self.R * i - self.k * w) / self.L,
            "speed": (self.k * i - self.d * w) / self.J,
        }


class Tank(js.Model):
    """A tank that empties through a hole, by Torricelli, and a gauge that shows the weight of its water."""

    states, inputs, outputs = ("level",), ("pump",), {"level": 0.002, "load": "estimate"}
    parameters: ClassVar = {"hole": {"bounds": [0.0, 1.0]}, "area": {"fixed": True}}
    area: Array
    hole: Array

    def rates(self, state, inputs, time):
        out = self.hole * jnp.sqrt(2.0 * 9.81 * jnp.maximum(state["level"], 1e-6))
        return {"level": (inputs["pump"] - out) / self.area}

    def shown(self, state, inputs, time):
        return {"load": 9810.0 * self.area * state["level"]}


class DoublePendulum(js.Model):
    """Two equal rods without mass, a bob at the end of each, and a motor at the hinge."""

    states, inputs = ("one", "two", "one_rate", "two_rate"), ("torque",)
    outputs: ClassVar = {"one": 0.01, "two": 0.01}
    m: Array
    b: Array
    length: float = 0.4

    def rates(self, state, inputs, time):
        a, b, p, q = (state[name] for name in self.states)
        m, L, g, apart = self.m, self.length, 9.81, a - b
        c, s = jnp.cos(apart), jnp.sin(apart)
        one = inputs["torque"] - m * L**2 * s * q**2 - 2.0 * m * g * L * jnp.sin(a) - self.b * p
        two = m * L**2 * s * p**2 - m * g * L * jnp.sin(b) - self.b * q
        scale = m * L**2 * (2.0 - c**2)
        return {"one": p, "two": q, "one_rate": (one - c * two) / scale, "two_rate": (2.0 * two - c * one) / scale}


def motor(x, u):
    """By the matrix of the same machine."""
    A = np.array([[-2.0 / 0.1, -0.5 / 0.1], [0.5 / 0.02, -0.01 / 0.02]])
    return A @ x + np.array([u / 0.1, 0.0])


def tank(x, u):
    return np.array([(u - 1e-3 * np.sqrt(2.0 * 9.81 * x[0])) / 0.5])


def double_pendulum(x, u):
    """From the mass matrix and the forces of Lagrange's equations."""
    a, b, p, q = x
    m, L, g, d = 0.3, 0.4, 9.81, 0.02
    M = m * L**2 * np.array([[2.0, np.cos(a - b)], [np.cos(a - b), 1.0]])
    turning = m * L**2 * np.sin(a - b) * np.array([q**2, -(p**2)])
    force = np.array([u, 0.0]) - turning - m * g * L * np.array([2.0 * np.sin(a), np.sin(b)]) - d * np.array([p, q])
    return np.array([p, q, *np.linalg.solve(M, force)])


CASES = {
    "motor": (Motor(R=2.0, L=0.1, k=0.5, J=0.02, d=0.01), motor, 0.01, 6.0, [0.0, 0.0]),
    "tank": (Tank(area=0.5, hole=1e-3), tank, 2.0, 2e-3, [0.3]),
    "double pendulum": (DoublePendulum(m=0.3, b=0.02), double_pendulum, 0.02, 1.5, [0.5, -1.0, 0.0, 0.0]),
}


def driven(model, dt, size, seed=1, samples=121):
    vehicle, t = js.own_model(model), dt * np.arange(samples)
    columns = {vehicle.layout.held[0]: size * (1.0 + 0.5 * prbs(samples, 10, 1.0, seed=seed))}
    nothing = dict.fromkeys(vehicle.layout.channels, np.full(samples, np.nan))
    return vehicle, js.Recording("run", t, columns | nothing, "run")


@pytest.mark.parametrize("case", CASES)
def test_own_model_moves_as_the_same_equations_by_scipy(case):
    """Claim: 120 samples differ by less than 1e-6 from SciPy's solution of equations written apart."""
    model, rates, dt, size, begin = CASES[case]
    vehicle, run = driven(model, dt, size)
    found = simulate(vehicle, stacked(vehicle, [run], substeps=16), jnp.array([begin]))[0]
    state, expected = np.array(begin), [begin]
    for held in run.column(vehicle.layout.held[0])[:-1]:
        state = solve_ivp(lambda t, x, u=held: rates(x, u), (0.0, dt), state, "DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
        expected.append(state)
    shown = [vehicle.layout.channels.index(name) for name in vehicle.layout.states if name in vehicle.layout.channels]
    np.testing.assert_allclose(np.asarray(found)[:, shown], np.array(expected)[:, : len(shown)], atol=1e-6)


def test_a_fit_finds_the_numbers_of_a_double_pendulum():
    """Claim: from 10 % off in mass and friction, a fit of noisy angles finds both to one per cent."""
    model, _, dt, size, begin = CASES["double pendulum"]
    vehicle, run = driven(model, dt, size)
    vehicle = vehicle.holding(["length"])
    made = stacked(vehicle, synthetic(vehicle, [run], seed=2, start=jnp.array([begin])), substeps=2)
    problem = Problem.of(
        vehicle.with_values({"m": jnp.asarray(0.33), "b": jnp.asarray(0.022)}), made, jnp.array([0.01, 0.01])
    )
    found = problem.split(gauss_newton().run(problem, problem.coordinates()[None]).y[0])[0].values()
    assert float(found["m"]) == pytest.approx(0.3, rel=0.01)
    assert float(found["b"]) == pytest.approx(0.02, rel=0.05)


def test_an_own_model_is_a_plant():
    """Claim: linearised in continuous time, the motor has the matrices of its equations."""
    vehicle, _ = driven(*CASES["motor"][0:1], 0.01, 6.0)
    linear = linearise_rates(discretise(vehicle, 0.01), jnp.zeros(2), jnp.zeros(1))
    np.testing.assert_allclose(linear.A, [[-20.0, -5.0], [25.0, -0.5]], atol=1e-12)
    np.testing.assert_allclose(linear.B, [[10.0], [0.0]], atol=1e-12)


SOURCE = """
import jax.numpy as jnp
from jaxtyping import Array

import jaxsub as js


class Tank(js.Model):
    states, inputs = ("level",), ("pump",)
    area: Array
    hole: Array

    def rates(self, state, inputs, time):
        out = self.hole * jnp.sqrt(2.0 * 9.81 * jnp.maximum(state["level"], 1e-6))
        return {"level": (inputs["pump"] - out) / self.area}
"""
FILE = """
schema = 1
name = "Tank"
kind = "model"
class = "tank.py:Tank"
[coefficients]
area = { value = 0.5, fixed = true }
hole = { value = 1e-3, bounds = [0.0, 1.0], prior_std = 1e-4 }
[inputs]
pump = "flow"
[outputs.level]
sigma = 0.002
"""


def written(folder, source=SOURCE, file=FILE):
    (folder / "tank.py").write_text(source, encoding="utf-8")
    (folder / "tank.toml").write_text(file, encoding="utf-8")
    return folder / "tank.toml"


def test_a_file_names_the_class_and_is_written_for_any_folder(tmp_path):
    """Claim: a file's numbers, bounds and columns hold; what is written elsewhere reads back as the same model."""
    vehicle = js.read_vehicle(written(tmp_path))
    assert vehicle.layout.states == ("level",) and vehicle.layout.held == ("flow",)
    (hole,) = vehicle.layout.free
    assert (hole.name, hole.lower, hole.upper, hole.prior_std) == ("hole", 0.0, 1.0, 1e-4)
    (tmp_path / "elsewhere").mkdir()
    js.write_vehicle(vehicle, tmp_path / "elsewhere" / "improved.toml")
    back = js.read_vehicle(tmp_path / "elsewhere" / "improved.toml")
    assert type(back.model) is type(vehicle.model) and back.layout == vehicle.layout


BAD = {
    "no class": (SOURCE, FILE.replace("tank.py:Tank", "tank.py:Tonk"), "has no model Tonk; did you mean Tank"),
    "no file": (SOURCE, FILE.replace("tank.py", "tonk.py"), "is no file"),
    "no colon": (SOURCE, FILE.replace("tank.py:Tank", "tank.py"), "names no class"),
    "a body's part": (SOURCE, FILE + "[body]\nmass = 1.0\n", "is a part of a submerged body"),
    "a class that fails": ("import nothing_at_all\n" + SOURCE, FILE, "tank.py fails"),
    "a missing number": (
        SOURCE,
        FILE.replace("area = { value = 0.5, fixed = true }\n", ""),
        "coefficients.area: is missing",
    ),
    "a mistyped number": (SOURCE, FILE.replace("hole =", "hule ="), "is no number of Tank; did you mean hole"),
    "another input": (SOURCE, FILE.replace("pump =", "pomp ="), "is no input of Tank"),
    "another channel": (SOURCE, FILE.replace("outputs.level", "outputs.levle"), "did you mean level"),
    "a rate too few": (SOURCE.replace('("level",)', '("level", "salt")'), FILE, "give one of each state: level, salt"),
    "rates that fail": (SOURCE.replace('inputs["pump"]', 'inputs["valve"]'), FILE, "Tank.rates fails"),
}


@pytest.mark.parametrize("case", BAD)
def test_models_that_cannot_be_are_refused_in_a_line(tmp_path, case):
    source, file, said = BAD[case]
    with pytest.raises(InputError) as error:
        js.read_vehicle(written(tmp_path, source, file))
    assert said in str(error.value) and "\n" not in str(error.value)
