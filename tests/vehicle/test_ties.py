"""A coefficient that follows from others is their expression, in every use of the vehicle."""

import tomllib

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from rigs import coupled, recorded

from jaxsub.errors import InputError
from jaxsub.estimate import fit
from jaxsub.information import identifiability
from jaxsub.vehicle import vehicle_from, vehicle_text

TREE = {
    "schema": 1, "name": "hull", "kind": "submerged-body", "dof": ["sway", "roll", "yaw"],
    "body": {"mass": 60.0, "inertia": [1.0, 12.0, 12.0], "speed": 1.5, "centre_of_buoyancy": [0.0, 0.0, -0.05]},
    "coefficients": {"Y_v": -90.0, "N_r": -30.0, "K_p": -2.0, "N_v": -5.0, "Y_v|v|": -40.0, "Y_delta_er": 8.0,
                     "K_delta_er": 1.5},
    "inputs": {"elevator_right": "er", "elevator_left": "el"},
    "outputs": {"v": {"sigma": 0.005}, "p": {"sigma": 0.005}, "r": {"sigma": 0.005}},
}  # fmt: skip


def arrays(values):
    return {name: jnp.asarray(value) for name, value in values.items()}


def hull(body=None, **more):
    tree = TREE | {"body": TREE["body"] | (body or {}), "coefficients": TREE["coefficients"] | more}
    return vehicle_from(tree, "hull.toml")


TIES = {
    "-K_delta_er": lambda v: -v["K_delta_er"],
    "0.35 * Y_delta_er / 2": lambda v: 0.35 * v["Y_delta_er"] / 2.0,
    "-(Y_v|v| + 2.5e1*Y_delta_er)**2 / 1e4": lambda v: -((v["Y_v|v|"] + 25.0 * v["Y_delta_er"]) ** 2) / 1e4,
    "mass / 100 - K_p": lambda v: v["mass"] / 100.0 - v["K_p"],
}


@pytest.mark.parametrize("text", TIES)
def test_number_follows_from_the_others(text):
    """Claim: as read, with other numbers, and in derivatives, the tied number is the expression of the others."""
    vehicle = hull(K_delta_el=text)
    plain = lambda values: float(TIES[text]({name: float(value) for name, value in values.items()}))
    assert float(vehicle.values()["K_delta_el"]) == pytest.approx(plain(vehicle.values()), rel=1e-14)
    other = vehicle.with_values(
        arrays({"K_delta_er": 2.0, "Y_delta_er": 7.0, "Y_v|v|": -9.0, "mass": 50.0, "K_p": -1.0})
    )
    assert float(other.values()["K_delta_el"]) == pytest.approx(plain(other.values()), rel=1e-14)
    assert "K_delta_el" not in [row.name for row in vehicle.layout.free]
    moved = lambda x: vehicle.with_values(arrays({"K_delta_er": x, "Y_delta_er": 4.0 * x})).values()["K_delta_el"]
    slope = (plain(_at(vehicle, 1.501)) - plain(_at(vehicle, 1.499))) / 0.002
    np.testing.assert_allclose(jax.jit(jax.grad(moved))(1.5), slope, rtol=1e-6, atol=1e-9)


def _at(vehicle, x):
    return vehicle.values() | {"K_delta_er": x, "Y_delta_er": 4.0 * x}


@pytest.mark.parametrize("make", [lambda: hull(K_delta_el="-K_delta_er"), lambda: coupled()], ids=["body", "rig"])
def test_tie_is_written_as_it_was_read(make):
    tree = tomllib.loads(vehicle_text(make()))
    if tree["kind"] == "mechanism":
        tree["coefficients"]["K_b"] = "2*K_a - D_b"
    vehicle = vehicle_from(tree, "vehicle.toml")
    again = vehicle_from(tomllib.loads(vehicle_text(vehicle)), "again.toml")
    assert again.layout.ties == vehicle.layout.ties != ()
    assert vehicle_text(again) == vehicle_text(vehicle)
    moved = again.with_values(arrays({"K_delta_er": 9.0, "K_a": 9.0})).values()
    assert float(moved.get("K_delta_el", -moved.get("K_b", 0.0) + 2 * 9.0 - 0.2 - 9.0)) == pytest.approx(-9.0)


@pytest.mark.long
def test_fit_of_tied_fins_counts_them_once_and_knows_them_better():
    """Claim: a tie makes the coefficient better known than both free, and is in the fit to the last digit."""
    truth = hull(K_delta_el="0.8 * K_delta_er", Y_delta_el="Y_delta_er")
    runs = recorded(truth, 2, 150, 0.1, seed=3)
    start = truth.with_values(arrays({"K_delta_er": 1.0, "Y_delta_er": 5.0, "Y_v": -80.0}))
    found = fit(start, runs)
    assert found.converged
    assert "K_delta_el" not in found.names
    values, errors = found.vehicle.values(), found.standard_errors
    assert abs(float(values["K_delta_er"]) - 1.5) < 4.0 * errors["K_delta_er"]
    assert float(values["K_delta_el"]) == pytest.approx(0.8 * float(values["K_delta_er"]), rel=1e-12)
    free = fit(hull(K_delta_el=1.2, Y_delta_el=8.0), runs)
    assert errors["K_delta_er"] < free.standard_errors["K_delta_er"]
    assert identifiability(found).parameters == len(found.names) == 7


REFUSED = {
    "no name": ("-1.5", "names no other number", "without quotation marks"),
    "unknown": ("-K_delta_re", "follows K_delta_re, which is no number", "did you mean K_delta_er?"),
    "itself": ("-K_delta_el", "follows K_delta_el itself", "give one of them a number"),
    "call": ("abs(K_p)", "is no expression", "+ - * / **"),
    "open": ("-(K_p", "is no expression", "+ - * / **"),
    "attribute": ("K_p.real", "follows K_p.real, which is no number of the vehicle", "known: "),
    "infinite": ("K_p / (N_v + 5)", "has no finite value", "mend"),
    "root": ("K_p ** 0.5", "has no finite value", "mend"),
    "huge": ("9**9**9**K_delta_er", "has no finite value", "mend"),
    "hidden": ("_0 + K_p", "follows _0", "known:"),
    "dimension": ("-Y_delta_er", "has another dimension than K_delta_el", "lever arm"),
    "sum": ("K_delta_er + Y_delta_er", "has another dimension than K_delta_el", "lever arm"),
    "long": ("K_p" + " + K_p" * 60, "characters", "200 at most"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused_in_one_line(case):
    text, *said = REFUSED[case]
    with pytest.raises(InputError) as refused:
        hull(K_delta_el=text)
    assert str(refused.value).startswith("hull.toml: coefficients.K_delta_el: ")
    assert all(words in str(refused.value) for words in said), str(refused.value)


def test_tie_in_a_batch_is_that_of_each_member():
    vehicle = hull(K_delta_el="-K_delta_er")
    sizes = jnp.linspace(0.5, 2.0, 5)
    found = jax.vmap(lambda x: vehicle.with_values(arrays({"K_delta_er": x})).values()["K_delta_el"])(sizes)
    np.testing.assert_array_equal(found, -sizes)


def test_a_product_over_the_speed_is_one_name_in_an_expression():
    """Claim: `Y_vvv/U` is the coefficient and not a quotient, also before a division by a number."""
    vehicle = hull(**{"Y_vvv/U": -3.0, "Y_vvr/U": "Y_vvv/U / 20"})
    assert float(vehicle.values()["Y_vvr/U"]) == pytest.approx(-0.15)


def test_body_follows_expressions_and_expressions_follow_each_other():
    """Claim: body data are tied as coefficients are, in any order of the file, and are written as they were read."""
    told = {"buoyancy": "weight", "weight": "9.81 * mass", "inertia": [1.0, 12.0, "I_y"]}
    vehicle = hull(told, K_delta_el="-K_delta_er", Y_delta_el="K_delta_el / 0.2")
    moved = vehicle.with_values(arrays({"mass": 70.0, "I_y": 13.0, "K_delta_er": 2.0})).values()
    found = [float(moved[name]) for name in ("weight", "buoyancy", "I_z", "Y_delta_el")]
    np.testing.assert_allclose(found, [9.81 * 70.0, 9.81 * 70.0, 13.0, -10.0], rtol=1e-14)
    again = vehicle_from(tomllib.loads(vehicle_text(vehicle)), "again.toml")
    assert vehicle_text(again) == vehicle_text(vehicle)
    assert tomllib.loads(vehicle_text(vehicle))["body"]["buoyancy"] == "weight"
    with pytest.raises(InputError, match=r"K_p: .* follows K_p itself, if through others"):
        hull(K_delta_el="2 * K_p", K_p="K_delta_el / 2")


def test_number_of_an_effect_follows_others():
    """Claim: an effect's number may follow a coefficient's, in use and when written."""
    lag = {"effect": "actuator-lag", "actuator": "elevator_right", "parameters": {"T": "-K_p / 10"}}
    vehicle = vehicle_from(TREE | {"effects": [lag]}, "hull.toml").with_values(arrays({"K_p": -3.0}))
    assert float(vehicle.values()["actuator-lag[elevator_right].T"]) == pytest.approx(0.3)
    again = vehicle_from(tomllib.loads(vehicle_text(vehicle)), "again.toml")
    assert vehicle_text(again) == vehicle_text(vehicle)


def test_bounds_and_prior_of_an_expression_are_those_of_the_number_that_it_follows():
    r"""Claim: of $-2\theta + 1$ they hold for $\theta$, and two priors are one with the product of their densities."""
    entry = {"value": "1 - 2 * K_delta_er", "bounds": [-5.0, -1.0], "prior_std": 0.2, "prior_mean": -2.2}
    own = {"value": 1.5, "prior_std": 0.3, "prior_mean": 1.4, "bounds": [1.2, 9.0]}
    row = {row.name: row for row in hull(K_delta_el=entry, K_delta_er=own).layout.free}["K_delta_er"]
    assert (row.lower, row.upper) == pytest.approx((1.2, 3.0))
    at = np.linspace(0.0, 3.2, 2001)
    density = np.exp(-0.5 * ((at - 1.4) / 0.3) ** 2 - 0.5 * ((1.0 - 2.0 * at + 2.2) / 0.2) ** 2)
    mean = np.sum(at * density) / np.sum(density)
    assert row.prior_mean == pytest.approx(mean, rel=1e-6)
    assert row.prior_std == pytest.approx(np.sqrt(np.sum((at - mean) ** 2 * density) / np.sum(density)), rel=1e-6)
    vehicle = hull(K_delta_el=entry, K_delta_er=own)
    again = vehicle_from(tomllib.loads(vehicle_text(vehicle)), "again.toml")
    assert again.layout.free == vehicle.layout.free
    # through another expression, and about the value where no mean is given
    chain = hull(K_delta_el="K_delta_er / 2", Y_delta_el={"value": "4 * K_delta_el", "prior_std": 0.5})
    row = {row.name: row for row in chain.layout.free}["K_delta_er"]
    assert (row.prior_mean, row.prior_std) == pytest.approx((1.5, 0.25))


LIMITED = {
    "fixed": ({"value": "-K_delta_er", "fixed": True}, "fixed: stands beside an expression; delete it"),
    "key": ({"value": "-K_delta_er", "bound": [0, 1]}, "bound: unknown key; did you mean bounds?"),
    "outside": ({"value": "-K_delta_er", "bounds": [0, 1]}, "value -1.5 lies outside its bounds"),
    "two": ({"value": "K_p - N_v / 2", "prior_std": 1.0}, "give bounds and prior to K_p and N_v"),
    "curved": ({"value": "0.1 * K_p * K_p", "prior_std": 1.0}, "give bounds and prior to K_p"),
    "unit": ({"value": "-K_delta_er", "unit": "N"}, "unit: is 'N', and the number is in N.m/rad"),
}


@pytest.mark.parametrize("case", LIMITED)
def test_what_cannot_stand_beside_an_expression_is_refused(case):
    entry, said = LIMITED[case]
    with pytest.raises(InputError, match=rf"hull\.toml: coefficients\.K_delta_el.*{said}"):
        hull(K_delta_el=entry)
