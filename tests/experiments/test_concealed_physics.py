"""The experiment on concealed physics makes the files it says, of the size it says, and scores answers as it says."""

import json

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.stats import binomtest

from experiments.concealed_physics import __main__ as battery
from experiments.concealed_physics import autopilot, bodies, engine, plan, scoring, truths
from experiments.concealed_physics.actuators import ACTUATORS
from experiments.concealed_physics.generate import generate
from experiments.concealed_physics.judge import judge
from experiments.concealed_physics.simulate import Drive, outputs, states, steered
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
    assert stop.command is not None
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
    case = plan.Case("sigma", 0, (KEY,), 5.0, plan.Way("double", seconds=20.0))
    truth = generate(case, tmp_path / "files")
    vehicle = read_vehicle(tmp_path / "files" / "vehicle.toml")
    stated = {output.channel: output.sigma for output in vehicle.layout.outputs}
    assert stated == {"x": 0.01, "x_rate": 0.02}
    # 100 samples: rms of white noise within 25 % at more than three standard errors
    assert all(abs(rms / stated[channel] - 0.5) < 0.125 for channel, rms in truth["floor"].items())
    off = {n: float(v) / float(bodies.body("rig").values()[n]) - 1.0 for n, v in vehicle.values().items()}
    assert all(0.1 <= abs(share) <= 0.2 for name, share in off.items() if name != "I_x")
    assert len(list((tmp_path / "files").glob("run*.csv"))) == 4
    assert "cubic" not in "".join(p.read_text() for p in (tmp_path / "files").iterdir())
    again = generate(case, tmp_path / "again")
    assert again == truth
    first, second = (load(tmp_path / folder / "run4.csv").columns["x"] for folder in ("files", "again"))
    np.testing.assert_array_equal(first, second)


def test_files_leave_sigma_to_the_judge_and_the_truth_keeps_it(tmp_path):
    """Claim: where sigma is to be estimated no channel's is in the file, and the truth has the noise in SI."""
    case = plan.Case("estimated", 0, (KEY,), 5.0, plan.Way("estimated", seconds=20.0))
    truth = generate(case, tmp_path / "files")
    assert [output.sigma for output in read_vehicle(tmp_path / "files" / "vehicle.toml").layout.outputs] == [None] * 2
    assert truth["floor"] == {"x": pytest.approx(0.005, rel=0.25), "x_rate": pytest.approx(0.01, rel=0.25)}


def test_an_autopilot_commands_what_its_law_makes_of_what_sensors_then_show():
    """Claim: driven by an autopilot's commands, sensors show what its law turns into them, and it gets where it should.

    A lag of the rudder and a delay of the compass reach back over the samples.
    """
    vehicle = bodies.body("nps")
    channels, rng = vehicle.layout.channels, np.random.default_rng(5)
    concealed = tuple(truths.TRUTHS[key] for key in ("nps/actuator-lag[rudder]", "nps/sensor-delay[psi]"))
    start = jnp.asarray(bodies.start_state("nps", vehicle, rng))
    course, depth = start[vehicle.layout.states.index("psi")], start[vehicle.layout.states.index("z")]
    wanted = jnp.tile(jnp.stack([course + 0.5, depth + 1.0, jnp.asarray(1.8), jnp.asarray(0.05)]), (200, 1))
    errors = jnp.asarray(1e-3 * rng.standard_normal((200, len(channels))))
    sizes = jnp.asarray([0.5, 0.3])
    held = steered(vehicle, concealed, sizes, start[None], wanted[None], errors[None])
    drive = Drive(start[None], held[:, :-1], jnp.zeros((1, 200, len(vehicle.layout.equations))))
    shown = np.asarray(outputs(vehicle, concealed, sizes, drive)[0])[0]
    measured = [dict(zip(channels, row, strict=True)) for row in shown + errors]
    again = [autopilot.command(*pair) for pair in zip(wanted, measured, strict=True)]
    np.testing.assert_allclose(held[0], np.stack(again), atol=1e-9)
    ended = dict(zip(channels, shown[-1], strict=True))
    assert abs(ended["psi"] - course - 0.5) < 0.1
    assert 0.5 < ended["z"] - depth < 1.5
    assert 0.01 < ended["phi"] < 0.1


def test_a_nonlinear_file_has_its_own_forces_and_conceals_others():
    """Claim: sway at rest in yaw meets the quadratic drag that the file states, and nothing it has is concealed."""
    plain, nonlinear = (bodies.body("nps", nonlinear=one) for one in (False, True))
    state = jnp.zeros(len(plain.layout.states)).at[jnp.asarray([0, 1])].set(jnp.asarray([plain.speed, 0.3]))
    signals = jnp.zeros(len(plain.layout.inputs) + 1)
    sway = lambda v: float((v.force(v.motion(state, signals)) + v.damping_matrix() @ state[:6])[1])
    assert sway(nonlinear) - sway(plain) == pytest.approx(-4200.0 * 0.3**2)
    names = {truths.TRUTHS[case.concealed[0]].name for case in plan.cases("nonlinear", 60)}
    assert len(names) > 25
    assert not names & {"coriolis-coupling", "quadratic-damping", "crossflow-drag", "current"}


def test_ten_effects_are_of_ten_kinds_on_one_vehicle():
    """Claim: no two of one family are the same effect, or in the same place."""
    for case in plan.cases("ten", 12):
        chosen = [truths.TRUTHS[key] for key in case.concealed]
        assert len({truth.name for truth in chosen}) == len(chosen) == 10
        assert len({(truth.family, truth.where) for truth in chosen}) == 10
        assert {truth.vehicle for truth in chosen} == {"nps"}


@pytest.mark.parametrize("fresh", [False, True])
def test_a_run_that_is_cut_off_has_every_condition_in_proportion(fresh):
    """Claim: of the first cases of the order, however many, each condition has its share to within two."""
    counts = {name: of.fresh if fresh else of.planned for name, of in plan.CONDITIONS.items()}
    listed = plan.ordered(counts, fresh)
    assert len({case.name for case in listed}) == len(listed) == sum(counts.values())
    assert len({case.seed for case in listed}) == len(listed)
    assert all(case.fresh is fresh for case in listed)
    for count in range(len(listed)):
        begun = [case.condition for case in listed[:count]]
        off = [begun.count(name) - count * of / len(listed) for name, of in counts.items()]
        assert max(map(abs, off)) < 2.0


def test_a_round_has_every_effect():
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


def many(verdict, names, after):
    """An answer that names `names`, and leaves `after` times the noise where the baseline leaves five times that."""
    return answer(verdict, *[(n, 1.0, []) for n in names]) | {
        "held_out_rms": {"baseline": {"y": 10.0}, "improved": {"y": 2.0 * after}}
    }


@pytest.mark.parametrize(
    "given, expected",
    [
        (many("named", "abc", after=2.0), True),
        (many("named", "abc", after=3.0), False),
        (many("named", "abx", after=1.0), False),
        (many("unknown", "", after=1.0), False),
        (many("named", "", after=1.0), False),
        (answer("named", ("a", 1.0, [])), True),
    ],
)
def test_of_many_effects_the_named_are_true_and_most_is_explained(given, expected):
    """Claim: three of ten effects suffice if none is false and 3/4 of the excess variance goes: 21/24, not 16/24."""
    assert scoring.right_of_many("abcdefghij", given, {"y": 2.0}) is expected


def test_a_folder_takes_answers_of_one_engine(tmp_path, monkeypatch, capsys):
    """Claim: a run does not go on from another engine's answers, and ends where the sources have changed since."""
    begun = {"case": "strong-000", "engine": {"commit": "0123456789", "sources": "of another"}}
    (tmp_path / "cases.jsonl").write_text(json.dumps(begun) + "\n")
    monkeypatch.setattr("sys.argv", ["battery", "--fresh", "--out", str(tmp_path)])
    with pytest.raises(SystemExit):
        battery.main()
    assert "0123456789" in capsys.readouterr().err
    engine.require(engine.engine())
    with pytest.raises(RuntimeError, match="0123456789"):
        engine.require(engine.Engine(**begun["engine"]))


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


@pytest.mark.long
def test_a_case_is_answered_from_its_files_and_counts_where_sigma_is_estimated(tmp_path):
    """Claim: a cubic spring is named in recordings of unknown noise, and the test error is that noise."""
    case = plan.Case("estimated", 0, (KEY,), 5.0, plan.Way("estimated", seconds=40.0))
    truth = generate(case, tmp_path)
    given = judge(tmp_path)
    assert scoring.right(truth["names"], given), given
    assert given["cpu_seconds"] > 0.0
    errors = scoring.held_out(given, truth["floor"])
    assert errors is not None
    assert errors["after"] == pytest.approx(1.0, abs=0.05) and errors["before"] > 1.5
