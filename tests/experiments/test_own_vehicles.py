"""The experiment on own vehicles conceals what it says and marks answers as it says; files hold none of the truth."""

import numpy as np
import pytest

from experiments.concealed_physics.simulate import Drive, outputs
from experiments.own_vehicles import plan, vehicles, work
from experiments.own_vehicles.generate import generate
from jaxsub.effects import vocabulary
from jaxsub.vehicle import read_vehicle

CASES = {case.name: case for case in plan.CASES}


def drive(trial, vehicle, samples=60):
    rng = np.random.default_rng(4)
    start, held = trial.start(vehicle, rng)[None], trial.drive(0, samples, rng)[None]
    return Drive(start, held[:, :-1], np.zeros((1, samples, len(vehicle.layout.equations))))


def test_every_case_has_a_name_of_its_own_and_conceals_what_the_vocabulary_names():
    assert len(CASES) == len(plan.CASES)
    names = {kind.name for kind in vocabulary()}
    concealed = [case.truth[0].name for case in plan.CASES if case.truth]
    assert set(concealed) <= names
    assert all(case.vehicle in vehicles.TRIALS for case in plan.CASES)
    assert sum(not case.truth and not case.factors for case in plan.CASES) >= 3
    assert all(not (case.truth and case.factors) for case in plan.CASES)


@pytest.mark.parametrize(
    ("case", "actuator"),
    [pytest.param("rov-weak-thruster", "t2", marks=pytest.mark.long), ("otter-weak-thruster", "right")],
)
def test_weak_thruster_in_the_generator_s_words_is_the_vehicle_with_that_gain(case, actuator):
    """Claim: the same motions to 1e-9 as the catalogue's vehicle with `gain = 0.8` on that thruster."""
    case = CASES[case]
    trial = vehicles.TRIALS[case.vehicle]
    vehicle = trial.make()
    items = vehicle.actuators.items
    weak = tuple(
        type(item)(**{**vars(item), "numbers": item.numbers | {"gain": np.asarray(0.8)}})
        if item.name == actuator
        else item
        for item in items
    )
    driven, (truth, size) = drive(trial, vehicle), case.truth
    other = type(vehicle)(**{**vars(vehicle), "actuators": type(vehicle.actuators)(weak)})
    one = np.asarray(outputs(vehicle, (truth,), np.array([size]), driven)[0])
    two, plain = (np.asarray(outputs(v, (), np.zeros(0), driven)[0]) for v in (other, vehicle))
    assert np.abs(one - plain).max() > 1e-2
    np.testing.assert_allclose(one, two, atol=1e-9)


def test_stream_carries_a_ship_that_is_at_rest_in_it():
    """Claim: moving with the water and undriven, it goes on so: no force but what the propeller at rest makes."""
    trial = vehicles.TRIALS["KVLCC2"]
    ship = trial.make()
    (truth, size) = CASES["ship-current"].truth
    start = np.zeros((1, len(ship.layout.states)))
    start[0, :2] = 0.8 * size, 0.6 * size
    still = Drive(start, np.zeros((1, 39, 2)), np.zeros((1, 40, 3)))
    shown = np.asarray(outputs(ship, (truth,), np.array([size]), still)[0])[0]
    u, v = (shown[:, ship.layout.channels.index(name)] for name in "uv")
    np.testing.assert_allclose(u, 0.8 * size, atol=1e-4)
    np.testing.assert_allclose(v, 0.6 * size, atol=1e-4)


def test_files_hold_the_catalogue_s_number_and_not_the_true_one(tmp_path):
    truth = generate(CASES["otter-drag"], tmp_path / "files")
    vehicle = read_vehicle(tmp_path / "files" / "vehicle.toml")
    nominal = float(vehicles.TRIALS["Otter"].make().values()["X_u"])
    assert float(vehicle.values()["X_u"]) == pytest.approx(nominal)
    assert truth["values"] == {"X_u": pytest.approx(1.4 * nominal)}
    assert "X_u" in [row.name for row in vehicle.layout.free]
    assert len(list((tmp_path / "files").glob("run*.csv"))) == 3
    assert all(abs(rms - 1.0) < 0.2 for rms in truth["floor"].values())


def answer(verdict, *entries, **more):
    return {"verdict": verdict, "physics": [{"effect": n, "rivals": r} for n, r in entries], **more}


EFFECT, NOTHING, NUMBER = (
    {"names": names, "values": values} for names, values in ((["a"], {}), ([], {}), ([], {"X_u": -7.0}))
)


@pytest.mark.parametrize(
    ("truth", "given", "expected"),
    [
        (EFFECT, answer("named", ("a", [])), "right"),
        (EFFECT, answer("ambiguous", ("b", [["a", 0.4]])), "ambiguous"),
        (EFFECT, answer("named", ("b", [])), "wrong"),
        (EFFECT, {"error": "it ended"}, "wrong"),
        (NOTHING, answer("none"), "right"),
        (NOTHING, answer("unknown"), "wrong"),
        (NUMBER, answer("none", values={"X_u": -7.1}, coefficients_p_value=0.0), "right"),
        (NUMBER, answer("none", values={"X_u": -5.0}, coefficients_p_value=0.0), "wrong"),
        (NUMBER, answer("none", values={"X_u": -7.1}, coefficients_p_value=0.5), "wrong"),
        (NUMBER, answer("named", ("a", []), values={"X_u": -7.0}, coefficients_p_value=0.0), "wrong"),
    ],
)
def test_answers_are_marked(truth, given, expected):
    assert work.mark(truth, given) == expected
