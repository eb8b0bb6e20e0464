"""The experiment on concealed physics makes the files it says, of the size it says, and scores answers as it says."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.stats import binomtest

from experiments.concealed_physics import bodies, plan, scoring, truths
from experiments.concealed_physics.actuators import ACTUATORS
from experiments.concealed_physics.generate import generate
from experiments.concealed_physics.simulate import Drive, states
from experiments.concealed_physics.sizing import Unabsorbed
from jaxsub.recording import load
from jaxsub.vehicle import read_vehicle

RIG = {"D": 0.4, "K": 4.0, "B": 2.0}
KEY = "rig/cubic-stiffness[x]"


def answer(verdict, *entries, where=()):
    physics = [{"effect": n, "probability": p, "rivals": r, "parameters": {}} for n, p, r in entries]
    return {"verdict": verdict, "physics": physics, "where": list(where)}


def drive(samples=60, runs=2):
    rng = np.random.default_rng(3)
    starts = rng.normal(size=(runs, 2)) * 0.1
    commands = np.stack([bodies.commands("rig", r, samples, rng)[:-1] for r in range(runs)])
    return Drive(jnp.asarray(starts), jnp.asarray(commands), jnp.zeros((runs, samples, 1)))


def test_integrator_agrees_with_scipy_on_a_concealed_cubic_spring():
    driven = drive(samples=20, runs=1)
    found = np.asarray(states(bodies.body("rig"), (truths.TRUTHS[KEY],), jnp.asarray([0.3]), driven))[0]
    y = np.array(driven.start[0])
    for k, force in enumerate(np.asarray(driven.commands[0, :, 0])):
        np.testing.assert_allclose(found[k], y, atol=1e-6)
        law = lambda t, s, f=force: [RIG["B"] * f - RIG["D"] * s[0] - RIG["K"] * s[1] - 0.3 * s[1] ** 3, s[0]]
        y = solve_ivp(law, (0.0, bodies.INTERVAL), y, rtol=1e-10, atol=1e-12).y[:, -1]


def test_lag_has_the_mean_of_the_exact_step_response():
    lag = next(t for t in ACTUATORS if t.name == "actuator-lag").command
    assert lag is not None
    h, seconds = 0.02, 0.5
    held = jnp.concatenate([jnp.zeros(5), jnp.ones(100)])
    edges = h * np.arange(101)
    # the integral of 1 - exp(-t/T) over each step, by its length
    integral = edges + seconds * np.exp(-edges / seconds)
    np.testing.assert_allclose(lag(jnp.asarray(seconds), h, held)[5:], np.diff(integral) / h, rtol=1e-9)


def test_a_concealed_stop_is_the_same_in_every_run():
    """Claim: runs of different largest commands stop at the one limit that the truth states."""
    stop = next(t for t in ACTUATORS if t.name == "actuator-saturation")
    drawn = [bodies.commands("nps", run, 800, np.random.default_rng(run))[:, 0] for run in range(4)]
    largest = [np.abs(held).max() for held in drawn]
    assert max(largest) - min(largest) > 0.01
    assert max(largest) <= bodies.LARGEST_RUDDER
    reached = [float(jnp.abs(stop.command(3.0, 0.2, jnp.asarray(held))).max()) for held in drawn]
    np.testing.assert_allclose(reached, stop.numbers(3.0)["limit"], rtol=1e-12)


def test_size_counts_only_what_no_coefficient_can_absorb():
    vehicle, driven = bodies.body("rig"), drive()
    seen = Unabsorbed(vehicle, driven, np.array([0.005, 0.01]))
    stiffer = vehicle.with_values({"K_x": vehicle.values()["K_x"] * (1.0 + 1e-5)})
    truth = (truths.TRUTHS[KEY],)
    moved = lambda v, a, steps: np.asarray(states(v, truth, jnp.asarray([a]), driven, steps))[..., ::-1]
    change = moved(stiffer, 0.0, 4) - seen.clean
    raw = np.sqrt(np.mean((change / [0.005, 0.01]) ** 2, axis=(0, 1))).max()
    assert seen.sigmas(seen.clean + change) < 1e-3 * raw
    amplitude, reached = seen.amplitude(truths.TRUTHS[KEY], 3.0)
    assert reached == pytest.approx(3.0, rel=0.02)
    # with ten steps a sample in place of four the size is the same
    assert seen.sigmas(moved(vehicle, amplitude, 10)) == pytest.approx(3.0, rel=0.03)


def test_files_hold_noise_of_the_true_sigma_and_state_the_misstated_one(tmp_path):
    case = plan.Case("sigma", 0, (KEY,), 5.0, noise="double", seconds=20.0)
    truth = generate(case, tmp_path / "files")
    vehicle = read_vehicle(tmp_path / "files" / "vehicle.toml")
    stated = {output.channel: output.sigma for output in vehicle.layout.outputs}
    assert stated == {"x": 0.01, "x_rate": 0.02}
    # 100 samples: rms of white noise within 25 % at more than three standard errors
    assert all(abs(rms - 0.5) < 0.125 for rms in truth["floor"].values())
    off = {n: float(v) / float(bodies.body("rig").values()[n]) - 1.0 for n, v in vehicle.values().items()}
    assert all(0.1 <= abs(share) <= 0.2 for name, share in off.items() if name != "I_x")
    assert len(list((tmp_path / "files").glob("run*.csv"))) == 4
    assert "cubic" not in "".join(p.read_text() for p in (tmp_path / "files").iterdir())
    again = generate(case, tmp_path / "again")
    assert again == truth
    first, second = (load(tmp_path / folder / "run4.csv").columns["x"] for folder in ("files", "again"))
    np.testing.assert_array_equal(first, second)


def test_a_short_plan_covers_every_condition_and_a_round_every_effect():
    listed = plan.ordered({c: n for c, (n, _) in plan.COUNTS.items()})
    assert len({case.name for case in listed}) == len(listed) == sum(n for n, _ in plan.COUNTS.values())
    assert len({case.seed for case in listed}) == len(listed)
    tenth = [case.condition for case in listed[: len(listed) // 10]]
    assert set(tenth) == set(plan.COUNTS)
    names = len(truths.by_name())
    first = [truths.TRUTHS[case.concealed[0]].name for case in plan.cases("strong", names)]
    assert sorted(first) == sorted(truths.by_name())


@pytest.mark.parametrize(
    "names, given, expected",
    [
        ((), answer("none"), True),
        ((), answer("unknown"), False),
        (("a",), answer("named", ("a", 0.9, [])), True),
        (("a",), answer("named", ("b", 0.6, [["a", 0.4]])), False),
        (("a",), answer("ambiguous", ("b", 0.5, [["a", 0.4], ["c", 0.1], ["c", 0.1]])), True),
        (("a",), answer("ambiguous", ("b", 0.4, [["c", 0.2], ["d", 0.2], ["e", 0.1], ["a", 0.1]])), False),
        (("a",), answer("named", ("a", 0.9, []), ("b", 0.9, [])), False),
        (("a", "b"), answer("named", ("b", 0.9, []), ("a", 0.9, [])), True),
        (("a", "b"), answer("ambiguous", ("a", 0.5, [["b", 0.5]])), False),
        (("a", "b"), answer("ambiguous", ("a", 0.5, [["b", 0.5]]), ("a", 0.9, [])), True),
        (("outside: x",), answer("unknown"), True),
        (("outside: x",), answer("named", ("a", 0.9, [])), False),
        (("a",), {"error": "no"}, False),
    ],
)
def test_right_is_named_or_among_at_most_four(names, given, expected):
    assert scoring.right(names, given) is expected


@pytest.mark.parametrize(
    "families, kinds, expected",
    [
        (["sensors"], {"structure": 0.2, "sensor": 0.8}, True),
        (["hull", "sensors"], {"structure": 0.9, "sensor": 0.1}, True),
        (["actuators"], {"structure": 0.9, "actuator": 0.1}, False),
        ([], {"disturbance": 0.6, "structure": 0.4}, True),
        ([], {"disturbance": 0.4, "structure": 0.6}, False),
        (["hull"], None, False),
    ],
)
def test_the_first_kind_is_that_of_a_concealed_effect(families, kinds, expected):
    assert scoring.first_kind(families, {"kinds": kinds}) is expected


@pytest.mark.parametrize(
    ("verdict", "alarm", "right"),
    [("none", False, True), ("unknown", False, False), ("named", True, False), ("ambiguous", True, False)],
)
def test_a_false_alarm_names_physics_where_nothing_is_concealed(verdict, alarm, right):
    given = answer(verdict, *[("a", 1.0, [])] * alarm)
    assert scoring.false_alarm(given) is alarm
    assert scoring.right([], given) is right


def test_every_concealed_effect_is_of_a_known_kind():
    """Claim: families of the concealed effects are those of the vocabulary, so that none is structure by mistake."""
    known = {"hull", "hydrostatics", "propulsion", "mechanisms", "outside", *scoring.KINDS}
    assert {truth.family for truth in truths.TRUTHS.values()} == known


def test_wilson_interval_is_scipys():
    for count, of in ((0, 7), (3, 10), (99, 100)):
        theirs = binomtest(count, of).proportion_ci(0.95, method="wilson")
        ours = scoring.rate(i < count for i in range(of))["interval"]
        assert ours is not None
        np.testing.assert_allclose(ours, [theirs.low, theirs.high], atol=1e-4)


def test_calibration_puts_each_statement_in_one_bin():
    pairs = scoring.forecasts(["a"], answer("ambiguous", ("a", 1.0, [["b", 0.0]]), ("c", 0.9, [])))
    bins = scoring.calibration(pairs)
    assert sum(cell["n"] for cell in bins) == 3
    assert [cell["rate"] for cell in bins] == [0.0, 0.0, 1.0]
