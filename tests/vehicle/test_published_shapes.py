"""Submarine, gliders, torpedo and work-class ROV of the catalogue against their equations in NumPy."""

import tomllib

import numpy as np
import published_equations as equations
import pytest
from rigs import stacked
from scipy.integrate import solve_ivp

from jaxsub.recording import Recording
from jaxsub.simulation import at_rest, prbs, simulate
from jaxsub.vehicle import catalogue, published_file, vehicle_from
from jaxsub.vehicle.like import PUBLISHED

FAST, SLOW = 0.004 * np.arange(101), 0.5 * np.arange(121)
PITCH, ROLL = -0.4 * np.sin(0.1 * SLOW), 0.1 * np.cos(0.2 * SLOW)
FINS = {f"delta_{name}": prbs(101, 30, 0.1, seed=seed) for seed, name in enumerate(("top", "bottom", "starboard"), 1)}
FINS |= {"delta_port": prbs(101, 30, 0.15, seed=4), "n": 100.0 + prbs(101, 40, 20.0, seed=5)}
ROTORS = {f"n{i}": prbs(101, 25, 500.0, seed=20 + i) for i in range(8)}
STEPS = {"delta_s": prbs(121, 20, 0.05, seed=7), "thrust": 120.0 + prbs(121, 30, 40.0, seed=8)}
TRIM = {"ballast": prbs(121, 60, 0.4, seed=9), "battery_position": prbs(121, 40, 0.02, seed=10)}
DIVE = {"vbd": prbs(121, 60, 2e-4, seed=11), "pitch": PITCH, "roll": ROLL}
BODY = "u v w p q r phi theta psi z"
RUNS = {
    "suboff": (SLOW, STEPS, "u w q theta z", {"u": 3.3}, 20.0),
    "seaglider": (SLOW, DIVE, "u w z", {"u": 0.25, "w": 0.01}, 3.0),
    "slocum": (SLOW, TRIM, "u w q theta z", {"u": 0.3, "w": 0.01}, 1.0),
    "torpedo": (FAST, FINS, BODY, {"u": 1.8, "v": 0.2, "w": -0.1, "r": 0.1}, 0.01),
    "rexrov": (FAST, ROTORS, BODY, {"u": 0.4, "v": 0.2, "w": -0.1, "r": 0.1, "z": 50.0}, 0.02),
}


@pytest.mark.parametrize("name", RUNS)
def test_vehicle_moves_by_its_source_s_equations(name):
    """Claim: a minute of a submarine and two gliders, and 0.4 s of a torpedo and an ROV, differ by less than 1e-6."""
    times, columns, states, begun, moved = RUNS[name]
    vehicle, states, step = getattr(catalogue, name)(), states.split(), float(times[1])
    columns = columns | dict.fromkeys(vehicle.layout.channels, np.full(len(times), np.nan))
    runs = stacked(vehicle, [Recording("run", times, columns, "run")], substeps=32)
    start = at_rest(vehicle, 1)
    for state, value in begun.items():
        start = start.at[0, vehicle.layout.states.index(state)].set(value)
    found = np.asarray(simulate(vehicle, runs, start)[0])
    inputs = np.stack([columns[column] for column in vehicle.layout.held], axis=1)
    state = np.array([begun.get(state, 0.0) for state in states])
    state = np.concatenate([state, inputs[0]]) if times is FAST else state  # actuators with a lag of their own
    between = [lambda t, c=column: np.interp(t, SLOW, c) for column in (PITCH, ROLL)] if name == "seaglider" else []
    rates, expected = getattr(equations, name), [state]
    for t, held in zip(times, inputs[:-1], strict=False):
        motion = lambda t, x, c=held: rates(t, x, c, *between)
        state = solve_ivp(motion, (t, t + step), state, method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
        expected.append(state)
    expected = np.stack([np.array(expected)[:, states.index(channel)] for channel in vehicle.layout.channels], axis=1)
    assert np.ptp(expected[:, vehicle.layout.channels.index("z")]) > moved
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_suboff_has_roddy_s_margin_of_stability():
    """Claim: 1 - M_w (Z_q + m)/(M_q Z_w) is the -1.162874 that Roddy prints, from the file's mass and derivatives."""
    value = {name: float(v) for name, v in catalogue.suboff().values().items()}
    margin = 1.0 - value["M_uw"] * (value["Z_uq"] + value["mass"]) / (value["M_uq"] * value["Z_uw"])
    assert margin == pytest.approx(-1.162874, rel=1e-4)


@pytest.mark.parametrize("name", PUBLISHED)
def test_every_published_vehicle_can_be_begun_with(name):
    """Claim: each name gives a file of 60 lines at most that names its source, and reads with the columns of a log."""
    text, _ = published_file(name)
    assert len(text.splitlines()) <= 60
    assert "# Source: " in text
    published = vehicle_from(tomllib.loads(text), name).layout
    columns = {column: np.zeros(3) for column in (*published.held, published.channels[0])}
    begun, unused = published_file(name, Recording("run", 0.1 * np.arange(3), columns, "run.csv"))
    layout = vehicle_from(tomllib.loads(begun), name).layout
    assert (layout.channels, layout.inputs, unused) == (published.channels[:1], published.inputs, [])
    assert "# Source: " in begun
