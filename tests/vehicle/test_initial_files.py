"""Vehicle files begun from dimensions: they read, move as vehicles do, and hold what is published of such vehicles."""

import dataclasses
import re
import tomllib

import jax.numpy as jnp
import numpy as np
import pytest
from rigs import stacked

from jaxsub.checks import check
from jaxsub.errors import InputError
from jaxsub.estimate import fit
from jaxsub.recording import Recording
from jaxsub.simulation import integrate, synthetic
from jaxsub.units import si_unit
from jaxsub.vehicle import initial_file, published_file, vehicle_findings, vehicle_from, vehicle_text

# the REMUS 100, the Slocum, the BlueROV2 Heavy, the KVLCC2 as a 7 m model, the Otter
SIZES = {
    "auv": {"length": 1.33, "diameter": 0.191, "mass": 30.5},
    "glider": {"length": 1.5, "diameter": 0.21, "mass": 52.0},
    "rov": {"length": 0.457, "beam": 0.436, "height": 0.254, "mass": 13.5, "density": 1000.0},
    "ship": {"length": 7.0, "beam": 1.27, "draught": 0.46, "mass": 3270.0, "density": 1000.0, "speed": 1.179},
    "usv": {"length": 2.0, "beam": 1.08, "draught": 0.195, "mass": 80.0},
}
# of the kinds' inputs, in SI, a usual command
COMMANDS = {
    "propeller": 5.0, "rudder": 0.1, "stern_plane": 0.05, "engine": -2.5e-4, "pitch_mass": 0.02, "shaft_speed": 60.0,
    "port": 20.0, "starboard": 15.0, "t1": 10.0, "t2": 12.0, "t3": -10.0, "t4": -10.0, "t5": 2.0, "t6": 2.0, "t7": 2.0,
    "t8": 2.0,
}  # fmt: skip


def begun(kind, log=None, **more):
    return vehicle_from(tomllib.loads(initial_file(kind, SIZES[kind] | more, log).text()), kind)


def log(**columns):
    samples = {name: np.asarray(values, float) for name, values in columns.items()}
    return Recording("run", 0.1 * np.arange(3), samples, "run.csv")


@pytest.mark.parametrize("kind", SIZES)
def test_a_file_is_short_and_has_nothing_odd(kind):
    """Claim: it is a vehicle without findings in 65 lines, whose free numbers all have a prior about their value."""
    assert len(initial_file(kind, SIZES[kind]).text().splitlines()) <= 65
    vehicle = begun(kind)
    assert vehicle_findings(vehicle, kind) == ()
    assert vehicle.layout.free
    values = vehicle.values()
    for row in vehicle.layout.free:
        assert 0.0 < row.prior_std < np.inf and row.prior_mean == float(values[row.name])


@pytest.mark.parametrize("kind", SIZES)
def test_from_rest_it_stays_or_moves_as_far_as_it_is_driven(kind):
    """Claim: without a command it does not move, and two minutes of commands leave it below 3 m/s and 2 rad/s."""
    vehicle = begun(kind)
    layout, times = vehicle.layout, 0.5 * np.arange(241)
    runs = []
    for driven in (0.0, 1.0):
        columns = {column: np.full(len(times), driven * COMMANDS[name]) for name, column in layout.inputs}
        columns |= {channel: np.full(len(times), np.nan) for channel in layout.channels}
        runs.append(Recording(f"run {driven}", times, columns, "run"))
    rest = jnp.zeros((2, len(layout.states)))
    still, moved = np.asarray(integrate(vehicle, stacked(vehicle, runs), rest))[:, :, : len(layout.equations)]
    linear = np.array([e in ("surge", "sway", "heave") for e in layout.equations])
    assert abs(still).max() < 1e-2  # of weight and buoyancy that are rounded
    assert abs(moved[:, linear]).max() < 3.0 and abs(moved[:, ~linear]).max() < 2.0
    assert moved[-1, 0] > 0.2


# Prestero (2001), with two misprints of a factor of ten in Y_v|v|; von Benzon et al. (2022) and Wu (2018), the BlueROV2
# without the Heavy's thrusters; Yasukawa and Yoshimura (2015), Y_Uv = -0.315 ½ρLd of the model and so on; Fossen
PUBLISHED = {
    ("auv", "Prestero"): {
        "X_udot": -0.93, "Y_vdot": -35.5, "Z_wdot": -35.5, "M_qdot": -4.88, "N_rdot": -4.88, "Y_rdot": 1.93,
        "Z_qdot": -1.93, "X_u|u|": -1.62, "Y_v|v|": -131.0, "Z_w|w|": -131.0, "N_r|r|": -9.4, "M_q|q|": -9.4,
    },
    ("rov", "von Benzon"): {
        "X_udot": -6.36, "Y_vdot": -7.12, "Z_wdot": -18.68, "K_pdot": -0.189, "M_qdot": -0.135, "N_rdot": -0.222,
        "X_u": -13.7, "Z_w": -33.0, "M_q": -0.8, "X_u|u|": -141.0, "Y_v|v|": -217.0, "Z_w|w|": -190.0,
        "K_p|p|": -1.19, "M_q|q|": -0.47, "N_r|r|": -1.5,
    },
    ("rov", "Wu"): {
        "X_udot": -5.5, "Y_vdot": -12.7, "Z_wdot": -14.57, "K_pdot": -0.12, "M_qdot": -0.12, "N_rdot": -0.12,
        "X_u|u|": -18.18, "Y_v|v|": -21.66, "Z_w|w|": -36.99, "K_p|p|": -1.55, "M_q|q|": -1.55, "N_r|r|": -1.55,
    },
    ("ship", "Yasukawa"): {
        "X_udot": -0.022 * 11270.0, "Y_vdot": -0.223 * 11270.0, "N_rdot": -0.011 * 552230.0,
        "X_u|u|": -0.022 * 1610.0, "X_vr": 0.225 * 11270.0, "Y_Uv": -0.315 * 1610.0, "Y_Ur": 0.083 * 11270.0,
        "N_Uv": -0.137 * 11270.0, "N_Ur": -0.049 * 78890.0,
    },
    ("usv", "Fossen"): {"X_udot": -5.5, "Y_vdot": -82.5, "N_rdot": -25.14},
}  # fmt: skip


@pytest.mark.parametrize(("kind", "author"), PUBLISHED)
def test_published_coefficients_lie_within_the_priors(kind, author):
    """Claim: of a vehicle of these dimensions nearly all lie within two standard deviations, and all within three."""
    published, estimates = PUBLISHED[kind, author], initial_file(kind, SIZES[kind]).coefficients
    off = {name: (value - estimates[name].value) / estimates[name].std for name, value in published.items()}
    assert max(map(abs, off.values())) < 3.0, off
    assert sum(abs(one) > 2.0 for one in off.values()) <= 0.1 * len(off) + 1, off


def test_added_mass_of_an_auv_is_that_of_remus():
    """Claim: Prestero's added mass is that of these dimensions within 30 %; he counts fins as if they were long."""
    estimates = initial_file("auv", SIZES["auv"]).coefficients
    for name in ("X_udot", "Y_vdot", "Z_wdot", "M_qdot", "N_rdot"):
        assert estimates[name].value == pytest.approx(PUBLISHED["auv", "Prestero"][name], rel=0.3), name


def test_inputs_and_outputs_are_columns_of_the_log():
    """Claim: columns are taken by name and unit, what the vehicle has no use for is listed, and each once."""
    file = initial_file("auv", SIZES["auv"], log(rudder_cmd=[0, 1, 0], r=[0, 0, 0], depth=[1, 1, 1], battery=[3, 3, 3]))
    vehicle = vehicle_from(tomllib.loads(file.text()), "auv")
    assert dict(vehicle.layout.inputs) == {"rudder": "rudder_cmd"}
    assert vehicle.layout.channels == ("r", "depth")
    assert file.unused == ["battery"] and "battery" in file.text()
    assert {"X_0", "Z_uq", "M_uq"} <= file.coefficients.keys()  # a constant thrust, and stern planes that stand still
    assert not {"Y_ur", "N_ur"} & file.coefficients.keys()


def test_a_fixed_fin_is_the_fin_that_is_not_deflected():
    """Claim: a log without a rudder gives the accelerations in a drift that one with a rudder amidships gives."""
    state = jnp.array([1.4, 0.1, -0.05, 0.02, 0.1, -0.2, 0.0, 0.1, 0.0, 2.0])
    every = begun("auv", log(delta_r=[0, 0, 0], delta_s=[0, 0, 0], thrust=[0, 0, 0], r=[0, 0, 0]))
    fixed = begun("auv", log(thrust=[0, 0, 0], r=[0, 0, 0]))
    moving = [np.asarray(v.acceleration(state, jnp.zeros(len(v.layout.inputs)))) for v in (every, fixed)]
    assert moving[0] == pytest.approx(moving[1], rel=1e-2, abs=1e-3)


@pytest.mark.parametrize(
    ("kind", "given", "said"),
    [
        ("auv", {"length": 1.0, "mass": 3.0}, "--diameter: is missing for an AUV"),
        ("auv", {"length": 1.0, "mass": 3.0, "diameter": 0.2, "draught": 1.0}, "--draught: is no dimension of an AUV"),
        ("auv", {"length": 1.0, "mass": -3.0, "diameter": 0.2}, "--mass: is -3"),
        ("auv", {"length": 1.0, "mass": 300.0, "diameter": 0.2}, "--mass: is 300 kg, and a cylinder"),
        ("auv", {"length": 1.0, "mass": 3.0, "diameter": 0.2, "fin_span": 0.1}, "--fin-chord: is missing"),
    ],
)
def test_dimensions_that_cannot_be_are_refused(kind, given, said):
    with pytest.raises(InputError, match=said):
        initial_file(kind, given)


def test_a_log_without_a_channel_is_refused():
    with pytest.raises(InputError, match="has none of the channels u, v"):
        initial_file("auv", SIZES["auv"], log(battery=[3, 3, 3]))


def driven_run(kind):
    """What a vehicle of that kind records in half a minute of commands that change at random, each in its own way."""
    vehicle, times = begun(kind), 0.1 * np.arange(300)
    steps = np.random.default_rng(5)
    columns = {}
    for name, column in vehicle.layout.inputs:
        ahead = 1.0 if name in ("propeller", "shaft_speed", "port", "starboard") else 0.0
        signal = ahead + np.repeat(steps.choice([-0.3, 0.3] if ahead else [-1.0, 1.0], 20), 15)
        columns[column] = 0.5 * COMMANDS[name] * signal
    (made,) = synthetic(vehicle, [Recording(kind, times, columns, f"{kind}.csv")], seed=2)
    units = {column: vehicle.layout.input_unit(name) for name, column in vehicle.layout.inputs}
    return dataclasses.replace(made, units={column: si_unit(unit) for column, unit in units.items() if unit})


@pytest.mark.parametrize("kind", SIZES)
def test_its_own_log_is_taken_and_checked_without_a_warning(kind):
    """Claim: every column of such a vehicle's log is used, and `check` has nothing to say against file and log."""
    made = driven_run(kind)
    file = initial_file(kind, SIZES[kind], made)
    assert file.unused == []
    vehicle = vehicle_from(tomllib.loads(file.text()), kind)
    assert set(vehicle.layout.held) == set(begun(kind).layout.held)
    findings = check(vehicle, [made]).findings
    assert [one.line() for one in findings if one.severity != "note"] == []


@pytest.mark.long  # the guide to begun files fits the catamaran
@pytest.mark.parametrize("kind", SIZES)
def test_a_fit_of_its_own_log_ends_near_the_truth(kind):
    """Claim: begun half a standard deviation off, it ends within four of its standard errors."""
    made, true = driven_run(kind), begun(kind).values()
    vehicle = vehicle_from(tomllib.loads(initial_file(kind, SIZES[kind], made).text()), kind)
    signs = np.random.default_rng(6).choice([-0.5, 0.5], len(vehicle.layout.free))
    start = {
        row.name: float(true[row.name]) + s * row.prior_std for row, s in zip(vehicle.layout.free, signs, strict=True)
    }
    found = fit(vehicle.with_values({name: jnp.asarray(value) for name, value in start.items()}), [made])
    off = {n: abs(found.values[n] - float(true[n])) / found.standard_errors[n] for n in start}
    assert max(off.values()) < 4.0, off


def test_names_of_columns_cannot_break_the_file():
    """Claim: columns with quotes or line breaks in their names are taken or listed, and the file reads."""
    odd = {'rudder"': [0, 1, 0], "a\nb": [1, 2, 3], "yaw_rate": [0, 0, 0], "r": [0, 0, 0]}
    file = initial_file("auv", SIZES["auv"], log(**odd))
    vehicle = vehicle_from(tomllib.loads(file.text()), "auv")
    assert dict(vehicle.layout.inputs) == {"rudder": 'rudder"'}
    assert "'a\\nb'" in file.text() and "yaw_rate (name it r if it is)" in file.text()
    assert set(file.unused) == odd.keys() - {'rudder"', "r"}


@pytest.mark.parametrize(("count", "taken"), [(9, 8), (7, 6), (6, 6), (2, 2), (1, 0)])
def test_an_rov_has_as_many_thrusters_as_its_log(count, taken):
    """Claim: pulse widths are counted from 1500, all thrusters follow the first, and commands over are listed."""
    widths = {f"motor_{i}_pwm": 1500.0 + 50.0 * np.arange(3) for i in range(1, count + 1)}
    file = initial_file("rov", SIZES["rov"], log(**widths, r=[0, 0, 0]))
    vehicle = vehicle_from(tomllib.loads(file.text()), "rov")
    assert [item.name for item in vehicle.actuators.items] == [f"t{i}" for i in range(1, taken + 1)]
    assert len(file.unused) == count - taken
    assert {float(item.numbers["neutral"]) for item in vehicle.actuators.items} <= {1500.0}
    assert sum(row.name.endswith(".forward") for row in vehicle.layout.free) == min(taken, 1)


@pytest.mark.parametrize("kind", SIZES)
def test_any_dimensions_give_a_vehicle_that_is_damped(kind):
    """Claim: from 10 cm to 300 m, slender or blunt, light or full, the file reads and motions are damped."""
    draw = np.random.default_rng(8)
    for _ in range(8):
        length = 10.0 ** draw.uniform(-1.0, 2.5)
        given = {"length": length, "density": draw.uniform(990.0, 1030.0), "speed": draw.uniform(0.1, 10.0)}
        named = {name for name in SIZES[kind] if name not in ("mass", *given)}
        given |= {name: length * draw.uniform(0.05, 0.9) for name in named}
        sides = [given[name] for name in named] * (2 if "diameter" in named else 1)
        given["mass"] = given["density"] * length * np.prod(sides) * draw.uniform(0.1, 0.75)
        vehicle = vehicle_from(tomllib.loads(initial_file(kind, given).text()), kind)
        values = {name: float(value) for name, value in vehicle.values().items()}
        own = [
            "X_u|u|",
            "Y_v|v|",
            "Z_w|w|",
            "N_r|r|",
            "Y_uv",
            "Z_uw",
            "Y_Uv",
            "N_Ur",
            "K_up",
            "X_udot",
            "Y_vdot",
            "N_rdot",
        ]
        assert all(values[name] < 0.0 for name in own if name in values), (given, values)


def test_coefficients_far_from_the_estimates_by_the_geometry_are_found():
    """Claim: Prestero's Y_vv, N_rr and M_qq, ten times those of strips or more, are warned of, and no other of his."""
    tree = tomllib.loads(published_file("remus-100")[0]) | {"geometry": {"kind": "auv"}}
    tree["body"] |= {"length": 1.33, "diameter": 0.191}
    vehicle = vehicle_from(tree, "remus")
    assert vehicle_from(tomllib.loads(vehicle_text(vehicle)), "again").layout.geometry == vehicle.layout.geometry
    found = {one.where: one for one in vehicle_findings(vehicle, "remus") if one.check == "geometry"}
    assert set(found) == {f"remus: coefficients.{name}" for name in ("Y_v|v|", "N_r|r|", "M_q|q|")}
    estimate = initial_file("auv", SIZES["auv"] | {"density": vehicle.density}).coefficients["Y_v|v|"]
    off = (estimate.value + 1310.0) / estimate.std
    assert f"is -1310 N/(m/s)/(m/s), {off:.1f} standard deviations" in found["remus: coefficients.Y_v|v|"].what


@pytest.mark.parametrize(
    ("geometry", "said"),
    [
        ({"kind": "auw"}, "geometry.kind: 'auw' is not known; did you mean auv?"),
        ({"kind": "auv", "beam": 1.0}, "geometry.beam: unknown key; known: kind, length, mass, diameter"),
        ({"kind": "auv", "diameter": 0.02}, "geometry.mass: is 30.5 kg, and a cylinder"),
        ({"kind": "ship", "beam": 0.2}, "geometry.draught: is missing for a ship; give it in m"),
    ],
)
def test_geometry_that_cannot_be_is_refused(geometry, said):
    tree = tomllib.loads(initial_file("auv", SIZES["auv"]).text()) | {"geometry": geometry}
    with pytest.raises(InputError, match=f"auv: {re.escape(said)}"):
        vehicle_from(tree, "auv")
