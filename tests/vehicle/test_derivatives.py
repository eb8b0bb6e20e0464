"""Coefficients by the field's grammar: what a symbol says, its unit and dimension, and how a file is refused."""

import itertools
import tomllib

import jax
import jax.numpy as jnp
import numpy as np
import pint
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rigs import body
from vehicle_texts import BODY

from jaxsub.effects import EQUATIONS, VELOCITIES, derivative
from jaxsub.errors import InputError
from jaxsub.vehicle import vehicle_findings, vehicle_from, vehicle_text
from jaxsub.vehicle.coefficient_units import coefficient_unit

UNITS = pint.UnitRegistry()
VARIABLES = {**dict.fromkeys("uvwU", "m/s"), **dict.fromkeys("pqr", "rad/s"), "n": "rad/s", "T": "N"}
VARIABLES |= dict.fromkeys(("delta_r", "delta_e"), "rad")
INPUTS = {"n": "shaft_speed", "T": "thrust", "delta_r": "rudder", "delta_e": "elevator"}
CASES = {
    "Y_v|v|": lambda m: abs(m["v"]) * m["v"],
    "Z_|w|w": lambda m: abs(m["w"]) * m["w"],
    "N_vvr": lambda m: m["v"] ** 2 * m["r"],
    "X_vr": lambda m: m["v"] * m["r"],
    "Y_uv": lambda m: m["u"] * m["v"],
    "X_nn": lambda m: abs(m["n"]) * m["n"],
    "X_n|n|": lambda m: abs(m["n"]) * m["n"],
    "X_|n||n|": lambda m: m["n"] ** 2,
    "K_ppp": lambda m: m["p"] ** 3,
    "M_|q|": lambda m: abs(m["q"]),
    "N_uu_delta_r": lambda m: m["u"] ** 2 * m["delta_r"],
    "N_uudelta_r": lambda m: m["u"] ** 2 * m["delta_r"],
    "X_delta_rdelta_r": lambda m: m["delta_r"] ** 2,
    "N_delta_r_T": lambda m: m["delta_r"] * m["T"],
    "Z_delta_e": lambda m: m["delta_e"],
    "Y_v|r|": lambda m: m["v"] * abs(m["r"]),
    "Y_vv|v|": lambda m: m["v"] ** 2 * abs(m["v"]),
    "Y_0": lambda m: 1.0,
    "Y_Uv": lambda m: speed(m) * m["v"],
    "X_UU": lambda m: speed(m) ** 2,
    "Y_vvv/U": lambda m: m["v"] ** 3 / speed(m),
    "X_vvvv/UU": lambda m: m["v"] ** 4 / speed(m) ** 2,
    "N_v|r|/U": lambda m: m["v"] * abs(m["r"]) / speed(m),
    "N_UU_delta_r": lambda m: speed(m) ** 2 * m["delta_r"],
}


def speed(m):
    return np.sqrt(m["u"] ** 2 + m["v"] ** 2 + m["w"] ** 2)


def hull(coefficients, **changes):
    """All six degrees of freedom with a rudder, an elevator, a thrust and a shaft, all of them recorded."""
    tree = {
        "schema": 1, "name": "hull", "kind": "submerged-body",
        "body": {"mass": 60.0, "inertia": [1.0, 12.0, 12.0], "speed": 1.5}, "coefficients": coefficients,
        "inputs": {"rudder": "dr", "elevator": "de", "thrust": "T", "shaft_speed": "n"},
        "outputs": {"r": {"sigma": 0.01}},
    }  # fmt: skip
    return vehicle_from(tree | changes, "hull.toml")


def moved(vehicle, seed=0):
    """A motion and the same by the letters of the field."""
    draws = np.random.default_rng(seed)
    state = jnp.asarray(draws.normal(size=(5, 6 + len(vehicle.layout.positions))))
    signals = jnp.asarray(draws.normal(size=(5, 4)))
    motion = vehicle.motion(state, signals)
    letters = {VELOCITIES[e]: np.asarray(motion.rates[e]) for e in EQUATIONS}
    return motion, letters | {letter: np.asarray(motion.actuators[name]) for letter, name in INPUTS.items()}


@pytest.mark.parametrize("name", CASES)
def test_symbol_is_the_product_that_it_spells(name):
    """Claim: a coefficient adds its number times the product, to its own equation alone."""
    plain, vehicle = hull({}), hull({name: 2.5})
    motion, letters = moved(vehicle)
    before, after = (np.asarray(one.force(motion)) for one in (plain, vehicle))
    expected = np.zeros_like(before)
    expected[:, "XYZKMN".index(name[0])] = 2.5 * CASES[name](letters)
    np.testing.assert_allclose(after - before, expected, rtol=1e-11, atol=1e-12)


@pytest.mark.parametrize("name", CASES)
def test_unit_times_product_is_a_force_or_a_moment(name):
    """Claim: by a units library the unit of every symbol makes N or N m of what it multiplies."""
    product = UNITS(coefficient_unit(name))
    above, _, below = name.partition("/")
    for letter in spelt(above):
        product = product * UNITS(VARIABLES[letter])
    product = product / UNITS("m/s") ** len(below)
    assert product.check("[force]" if name[0] in "XYZ" else "[force] * [length]")


def spelt(name):
    """The letters of a symbol, deltas whole."""
    symbol = name[2:].replace("|", "")
    for delta in ("delta_r", "delta_e"):
        yield from [delta] * symbol.count(delta)
        symbol = symbol.replace(delta, "")
    yield from symbol.replace("_", "").replace("0", "")


FACTORS = ["u", "v", "U", "p", "|v|", "|r|", "n", "|n|", "T", "delta_r", "|delta_r|"]


@settings(derandomize=True, deadline=None, max_examples=200)
@given(st.lists(st.sampled_from(FACTORS), max_size=5))
def test_order_of_factors_says_nothing_and_a_name_is_read_back(factors):
    """Claim: any order of the same factors is one derivative, and its own name says it again."""
    said = {derivative("Y_" + ("_".join(some) or "0")) for some in itertools.islice(itertools.permutations(factors), 8)}
    (one,) = said
    assert one is not None
    assert derivative(one.name) == one


def test_forces_are_differentiable_jittable_and_batched():
    """Claim: gradients at rest are finite and right, and vmap of the acceleration is the acceleration of the batch."""
    vehicle = hull({"Y_v|v|": -3.0, "N_uv": -2.0, "X_nn": 1e-3, "Y_v": -5.0})
    state, signals = jnp.zeros(6 + len(vehicle.layout.positions)), jnp.zeros(4)
    slopes = jax.jit(jax.jacfwd(vehicle.acceleration))(state.at[0].set(2.0), signals)
    np.testing.assert_allclose(slopes[5, 1], -2.0 * 2.0 / 12.0, rtol=1e-12)
    assert np.isfinite(jax.jacrev(vehicle.acceleration)(state, signals)).all()
    draws = np.random.default_rng(3)
    states, inputs = jnp.asarray(draws.normal(size=(4, len(state)))), jnp.asarray(draws.normal(size=(4, 4)))
    batched = jax.vmap(vehicle.acceleration)(states, inputs)
    np.testing.assert_allclose(batched, vehicle.acceleration(states, inputs), rtol=1e-12)


REFUSED = {
    "letter": ({"Y_vx": -1.0}, "coefficients.Y_vx: unknown key", "known: a force X Y Z K M N"),
    "over another": ({"Y_vvv/u": -1.0}, "coefficients.Y_vvv/u: unknown key", "over /U"),
    "misspelt": ({"Y_vv|": -1.0}, "coefficients.Y_vv|: unknown key", "did you mean Y_v|v|?"),
    "too high": ({"Y_vvvvvvv": -1.0}, "coefficients.Y_vvvvvvv: unknown key", "known:"),
    "rate of a product": ({"Y_vvdot": -1.0}, "coefficients.Y_vvdot: unknown key", "did you mean Y_vdot?"),
    "twice": ({"Y_v|v|": -1.0, "Y_|v|v": -1.0}, "coefficients.Y_|v|v", "says what Y_v|v| says"),
    "no such input": ({"Z_uu_delta_s": -1.0}, "Z_uu_delta_s: acts through stern_plane", "[inputs]"),
    "unit": ({"Y_v|v|": {"value": -1.0, "unit": "N/(m/s)"}}, "Y_v|v|.unit", "N/(m/s)/(m/s)"),
    "system": ({"system": {"name": "prim"}, "Y_v": -1.0}, "coefficients.system.name", "did you mean prime?"),
    "size": ({"system": {"name": "bis", "length": 2.0}}, "coefficients.system.mass: is missing", "add mass"),
    "key": ({"system": {"name": "bis", "length": 2.0, "mass": 1.0, "rho": 1.0}}, "system.rho: unknown key", "mass"),
    "sign": ({"system": {"name": "bis", "length": -2.0, "mass": 1.0}}, "system.length: is -2", "positive"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused_in_one_line_that_says_where_and_what_to_do(case):
    coefficients, *said = REFUSED[case]
    with pytest.raises(InputError) as refused:
        hull(coefficients)
    assert str(refused.value).startswith("hull.toml: ")
    assert all(words in str(refused.value) for words in said), str(refused.value)


def test_prime_numbers_are_converted_by_their_dimension_and_shown():
    """Claim: the file's conversion is that of a hand calculation for each kind of derivative, bounds and all."""
    system = {"name": "prime", "length": 5.3, "density": 1000.0, "speed": 1.832}
    prime = {
        "Y_v": {"value": -0.1, "bounds": [-0.2, 0.0], "prior_std": 0.01}, "Y_uv": -0.1, "N_ur": -0.016, "K_p|p|": -0.01,
        "N_rdot": -0.0034, "Y_rdot": 0.0012, "N_uu_delta_r": -0.013, "N_delta_r": -0.013, "X_0": 0.004, "X_T": 1.0,
        "M_w": {"value": 12.0, "unit": "N*m/(m/s)"},
    }  # fmt: skip
    vehicle = hull({"system": system} | prime)
    q, L, U = 0.5 * 1000.0, 5.3, 1.832
    expected = {
        "Y_v": -0.1 * q * L**2 * U, "Y_uv": -0.1 * q * L**2, "N_ur": -0.016 * q * L**4, "K_p|p|": -0.01 * q * L**5,
        "N_rdot": -0.0034 * q * L**5, "Y_rdot": 0.0012 * q * L**4, "N_uu_delta_r": -0.013 * q * L**3,
        "N_delta_r": -0.013 * q * L**3 * U**2, "X_0": 0.004 * q * L**2 * U**2, "X_T": 1.0, "M_w": 12.0,
    }  # fmt: skip
    values = vehicle.values()
    for name, value in expected.items():
        np.testing.assert_allclose(float(values[name]), value, rtol=1e-12, err_msg=name)
    row = next(row for row in vehicle.layout.parameters if row.name == "Y_v")
    unit = q * L**2 * U
    np.testing.assert_allclose([row.lower, row.prior_std, row.prior_mean], [-0.2 * unit, 0.01 * unit, -0.1 * unit])
    found = [one for one in vehicle_findings(vehicle, "hull.toml") if one.check == "non-dimensional"]
    said = "of sway in SI, from the prime system (length 5.3 m, density 1000 kg/m³, speed 1.832 m/s): "
    (note,) = [one for one in found if one.what.startswith(said)]
    assert f"Y_v = {expected['Y_v']:.6g} N/(m/s)" in note.what
    again = vehicle_from(tomllib.loads(vehicle_text(vehicle)), "again.toml")
    assert {n: float(v) for n, v in again.values().items()} == {n: float(v) for n, v in values.items()}


def test_mmg_numbers_are_converted_by_length_and_draught():
    """Claim: of half the density times length times draught, with the powers of length that Yasukawa prints."""
    system = {"name": "mmg", "length": 7.0, "draught": 0.46, "density": 1000.0, "speed": 1.18}
    mmg = {"Y_vdot": -0.223, "X_UU": -0.022, "Y_Uv": -0.315, "N_Ur": -0.049, "Y_vvv/U": -1.607, "N_vrr/U": 0.055}
    values = hull({"system": system} | mmg).values()
    side, L = 0.5 * 1000.0 * 7.0 * 0.46, 7.0
    expected = {"Y_vdot": side * L, "X_UU": side, "Y_Uv": side, "N_Ur": side * L**2, "Y_vvv/U": side}
    for name, unit in (expected | {"N_vrr/U": side * L**3}).items():
        np.testing.assert_allclose(float(values[name]), mmg[name] * unit, rtol=1e-12, err_msg=name)


def test_bis_numbers_are_converted_by_mass_length_and_gravity():
    vehicle = hull({"system": {"name": "bis", "length": 4.0, "mass": 60.0}, "Y_uv": -1.2, "N_r": -0.5})
    np.testing.assert_allclose(float(vehicle.values()["Y_uv"]), -1.2 * 60.0 / 4.0, rtol=1e-12)
    expected = -0.5 * 60.0 * 4.0**2 * np.sqrt(9.80665 / 4.0)
    np.testing.assert_allclose(float(vehicle.values()["N_r"]), expected, rtol=1e-12)


def test_thrust_pushes_by_its_own_coefficient_where_there_is_one():
    """Claim: a thrust deduction of a tenth is `X_T = 0.9`, and does not come on top of the whole thrust."""
    whole, less = hull({}), hull({"X_T": 0.9})
    motion, letters = moved(whole)
    for vehicle, share in ((whole, 1.0), (less, 0.9)):
        push = np.asarray(vehicle.force(motion))[:, 0]
        np.testing.assert_allclose(push, share * letters["T"], atol=1e-12)


def test_what_changes_nothing_or_is_said_twice_is_reported():
    tree = tomllib.loads(BODY)
    tree["coefficients"] |= {"Y_wq": 1.0, "Y_uv": 1.0, "Y_v|v|": -2.0}
    found = {one.check: one for one in vehicle_findings(vehicle_from(tree, "body.toml"), "body.toml")}
    assert "Y_wq act" in found["locked"].what
    assert "Y_uv" not in found["locked"].what
    assert "quadratic-damping[sway]" in found["said-twice"].where


def test_an_input_that_acts_through_a_product_alone_is_not_idle():
    assert not [one for one in vehicle_findings(body(), "b") if one.check == "idle-input" and "rudder" in one.where]
    vehicle = hull({"N_uu_delta_r": -1.0, "Z_uu_delta_e": -1.0, "X_nn": 1e-3})
    assert not [one for one in vehicle_findings(vehicle, "hull.toml") if one.check == "idle-input"]
