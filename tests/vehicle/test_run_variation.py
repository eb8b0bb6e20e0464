"""A number that differs by run: as read and written, and in motion, where each run has its own."""

import tomllib

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from rigs import oscillator, recorded

from jaxsub.errors import InputError
from jaxsub.simulation import sampled_states
from jaxsub.vehicle import vehicle_from, vehicle_text

TREE = {
    "schema": 1, "name": "hull", "kind": "submerged-body", "dof": ["heave", "pitch", "yaw"],
    "body": {"mass": 60.0, "inertia": [1.0, 12.0, 12.0], "speed": 1.5, "centre_of_buoyancy": [0.0, 0.0, -0.05],
             "buoyancy": {"value": 590.0}},
    "coefficients": {"Z_wdot": -40.0, "Z_w": -90.0, "M_q": -30.0, "M_w": -5.0, "Z_w|w|": -40.0, "N_r": -20.0,
                     "M_delta_e": 8.0, "N_delta_e": 0.5},
    "inputs": {"elevator": "e"},
    "outputs": {"w": {"sigma": 0.005}, "z": {"sigma": 0.005, "offset": 0.0}},
}  # fmt: skip


def hull(varying):
    """The hull, each of the numbers `varying` (section.name) with what it has beside its value."""
    tree = {key: dict(part) if isinstance(part, dict) else part for key, part in TREE.items()}
    for name, more in varying.items():
        section, _, key = name.rpartition(".")
        table = tree
        for part in section.split("."):
            table[part] = dict(table[part])
            table = table[part]
        old = table[key]
        table[key] = (dict(old) if isinstance(old, dict) else {"value": old}) | more
    return vehicle_from(tree, "hull.toml")


BY_RUN = {"varies": "run", "spread": 0.5}
SORTS = {
    "body.buoyancy": 8.0,
    "body.mass": 9.0,
    "coefficients.Z_wdot": -7.0,
    "coefficients.Z_w": -20.0,
    "coefficients.Z_w|w|": 15.0,
    "coefficients.M_delta_e": 2.0,
    "outputs.z.offset": 0.4,
}


LONG = {"body.mass", "coefficients.Z_w|w|", "coefficients.Z_wdot", "coefficients.M_delta_e"}


@pytest.mark.parametrize("place", [pytest.param(p, marks=[pytest.mark.long] if p in LONG else []) for p in SORTS])
def test_a_run_moves_as_the_vehicle_with_its_number(place):
    """Claim: accelerations, outputs and their gradient are those of a vehicle without variation that has the number."""
    name = place.removeprefix("outputs.").removeprefix("body.").removeprefix("coefficients.")
    vehicle, plain = hull({place: BY_RUN}), hull({})
    assert vehicle.layout.states == (*plain.layout.states, f"{name}.deviation")
    rng = np.random.default_rng(0)
    state = jnp.asarray(rng.normal(0.0, 0.3, (4, len(plain.layout.states))))
    signals = jnp.asarray(rng.normal(0.0, 0.2, (4, 1)))
    times = 0.1 * jnp.arange(4.0)

    def shown(deviation):
        x = jnp.concatenate([state, jnp.full((4, 1), deviation)], axis=1)
        return (
            vehicle.acceleration(x, signals),
            vehicle.measure(times, x, signals),
            vehicle.acceleration(x[0], signals[0]),
        )

    def expected(change):
        own = plain.with_values({name: plain.values()[name] + change})
        return (
            own.acceleration(state, signals),
            own.measure(times, state, signals),
            own.acceleration(state[0], signals[0]),
        )

    change = SORTS[place]
    for ours, theirs in zip(shown(change), expected(change), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-10, atol=1e-12)
    for ours, theirs in zip(jax.jacfwd(shown)(change), jax.jacfwd(expected)(change), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-8, atol=1e-12)


def test_simulated_runs_are_those_of_their_own_vehicles():
    """Claim: the sampled step carries runs with inertia and damping of their own as those of several vehicles."""
    coefficients = {"I_x": 1.0, "D_x": 0.6, "K_x": 4.0, "B_x_drive": 2.0}
    varied = {name: {"value": coefficients[name]} | BY_RUN for name in ("I_x", "D_x")}
    plain, vehicle = oscillator(coefficients=coefficients), oscillator(coefficients=coefficients | varied)
    runs, changes = recorded(plain, 2, 40, 0.1, seed=1), np.array([[-0.3, 0.5], [0.8, -0.4]])
    found = sampled_states(vehicle, runs, jnp.asarray(np.concatenate([np.zeros((2, 2)), changes], axis=1)))
    for index, change in enumerate(changes):
        own = plain.with_values(
            {name: jnp.asarray(coefficients[name] + d) for name, d in zip(varied, change, strict=True)}
        )
        alone = sampled_states(own, runs, jnp.zeros((2, 2)))[index]
        np.testing.assert_allclose(found[index, :, :2], alone, atol=1e-4 * np.abs(alone).max())


def test_a_tied_number_follows_the_run():
    """Claim: what follows from a number that differs by run is that run's."""
    tree = TREE | {
        "coefficients": TREE["coefficients"] | {"M_delta_e": {"value": 8.0} | BY_RUN, "N_delta_e": "M_delta_e / 2"}
    }
    vehicle, plain = vehicle_from(tree, "hull.toml"), hull({})
    own = plain.with_values({"M_delta_e": jnp.asarray(10.0), "N_delta_e": jnp.asarray(5.0)})
    state, signals = 0.1 * jnp.ones(len(plain.layout.states)), jnp.array([0.2])
    found = vehicle.acceleration(jnp.append(state, 2.0), signals)
    np.testing.assert_allclose(found, own.acceleration(state, signals), rtol=1e-12)


def test_it_is_written_as_it_is_read():
    """Claim: a file with both forms reads back the same, and a spread that was found is written."""
    vehicle = hull({"body.buoyancy": {"varies": "run"}, "coefficients.Z_w": BY_RUN | {"bounds": [-200.0, 0.0]}})
    again = vehicle_from(tomllib.loads(vehicle_text(vehicle)), "again.toml")
    assert again.layout.states == vehicle.layout.states
    assert {row.name: row for row in again.layout.free} == {row.name: row for row in vehicle.layout.free}
    assert np.isnan(float(again.spreads["buoyancy"])) and float(again.spreads["Z_w"]) == 0.5
    found = vehicle.with_spreads({"buoyancy": 1.25})
    assert float(vehicle_from(tomllib.loads(vehicle_text(found)), "x").spreads["buoyancy"]) == 1.25
    assert "buoyancy = 590 N, differs by run" in repr(vehicle)
    assert vehicle.at_mean.layout.states == hull({}).layout.states and not vehicle.at_mean.spreads


REFUSED = {
    'body.buoyancy.varies: is .runs.; write varies = "run"': {"body.buoyancy": {"varies": "runs"}},
    'buoyancy.spread: is given without varies; add varies = "run"': {"body.buoyancy": {"spread": 1.0}},
    "buoyancy.spread: is -1; give a positive number": {"body.buoyancy": {"varies": "run", "spread": -1.0}},
    "buoyancy: is fixed and differs by run; delete fixed, or varies": {"body.buoyancy": BY_RUN | {"fixed": True}},
    "Z_w: value -90 lies outside its bounds": {"coefficients.Z_w": {"bounds": [-10.0, 0.0]}},
    "Z_w.varies: stands beside an expression; delete it, or write it beside what this follows": {
        "coefficients.Z_w": BY_RUN | {"value": "-N_r"}
    },
    "Z_w.prior_std: is -2; give a positive number": {"coefficients.Z_w": {"prior_std": -2}},
}


@pytest.mark.parametrize("message", REFUSED)
def test_bad_input_is_one_line(message):
    """Claim: what cannot be is refused by its key, with what to do."""
    with pytest.raises(InputError, match=message):
        hull(REFUSED[message])


def test_a_column_before_the_model_cannot_differ_by_run():
    """Claim: the scale of an input's column is refused."""
    elevator = {"column": "e", "scale": {"value": 1.0, "free": True, "varies": "run"}}
    with pytest.raises(InputError, match=r"elevator\.scale\.varies: cannot differ by run; delete it; these can"):
        vehicle_from(TREE | {"inputs": {"elevator": elevator}}, "hull.toml")
