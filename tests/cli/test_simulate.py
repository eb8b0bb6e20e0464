"""`jaxsub simulate` starts where it says, and its errors are those that a fit and a diagnosis of the vehicle have."""

import dataclasses
import json

import jax.numpy as jnp
import numpy as np
import pytest
from commands import ran
from rigs import driven, oscillator
from scipy.integrate import solve_ivp

from jaxsub.estimate import batch, channel_rms, fit, search
from jaxsub.likelihood import output_errors
from jaxsub.recording import load, save
from jaxsub.simulation import synthetic
from jaxsub.vehicle import read_vehicle, write_vehicle

BEGAN = {"x": 0.3, "x_rate": -0.4}
TIMES = np.concatenate([0.1 * np.arange(60), 6.0 + 0.12 * np.arange(40)])
# of a sampled model's answer at these intervals: a tenth of the position's noise
EXACT = 1e-3


@pytest.fixture
def rig(tmp_path):
    """An oscillator whose stiffness is a tenth off, and a run of the true one that starts in motion."""
    vehicle = oscillator()
    start = jnp.array([[BEGAN[name] for name in vehicle.layout.states]])
    made = synthetic(vehicle, [driven(vehicle, TIMES, seed=1, amplitude=1.0)], seed=1, start=start)[0]
    save(made, tmp_path / "run.csv")
    write_vehicle(vehicle.with_values({"K_x": jnp.asarray(4.4)}), tmp_path / "vehicle.toml")
    return tmp_path


def rewrite(folder, change):
    """The run with its table of named columns changed."""
    run = load(folder / "run.csv")
    columns = {name: np.array(values) for name, values in run.columns.items()}
    save(dataclasses.replace(run, columns=change(columns)), folder / "changed.csv")
    return folder / "changed.csv"


def simulated(monkeypatch, capsys, folder, *options, run="run.csv"):
    files = [folder / "vehicle.toml", folder / run, "--out", folder / "answer.csv"]
    return ran(monkeypatch, capsys, "simulate", *files, *options)


def told(monkeypatch, capsys, folder, *options, **others):
    code, said = simulated(monkeypatch, capsys, folder, "--json", *options, **others)
    assert code == 0, said.err
    return json.loads(said.out)


@pytest.mark.long
def test_the_error_is_that_of_a_fit_and_of_a_search(rig, monkeypatch, capsys):
    """Claim: from the estimated start rms/σ is `fit`'s with every coefficient fixed, and a search's of the start."""
    found = told(monkeypatch, capsys, rig)
    assert found["start"] == "estimated"
    over = {channel: one["rms_over_sigma"] for channel, one in found["fit"].items()}
    vehicle, run = read_vehicle(rig / "vehicle.toml"), load(rig / "run.csv")
    runs = batch(vehicle, [run])
    fixed = vehicle.holding([row.name for row in vehicle.layout.free])
    assert not fixed.layout.free
    assert over == pytest.approx(fit(fixed, runs).rms, rel=1e-6)
    sigma = jnp.array([output.sigma for output in vehicle.layout.outputs])
    start = search(vehicle, runs, sigma=sigma, moving=False).start
    error = output_errors(vehicle, runs, start) / sigma
    assert over == pytest.approx(channel_rms(error, runs, vehicle.layout.channels), rel=1e-6)
    assert max(over.values()) > 2.0


@pytest.mark.parametrize("start", ["rest", "recorded", "estimated"])
def test_the_answer_is_the_equation_solved_from_the_start_that_is_stated(rig, monkeypatch, capsys, start):
    """Claim: by an independent solver, from the stated initial state; the rms over the samples is the table's."""
    found = told(monkeypatch, capsys, rig, "--start", start)
    assert found["start"] == start
    run, answer = load(rig / "run.csv"), load(rig / "answer.csv")
    first = {name: float(run.column(name)[0]) for name in BEGAN}
    expected = {"rest": dict.fromkeys(BEGAN, 0.0), "recorded": first}.get(start, BEGAN)
    assert found["initial_state"] == pytest.approx(expected, abs=0.2 if start == "estimated" else 1e-12)
    state, states = [found["initial_state"][name] for name in BEGAN], []
    for k, force in enumerate(run.column("f")):
        states.append(state)
        if k + 1 < len(run.times):
            rate = lambda t, s, force=force: [s[1], 2.0 * force - 0.6 * s[1] - 4.4 * s[0]]
            state = solve_ivp(rate, (0.0, run.times[k + 1] - run.times[k]), state, rtol=1e-10, atol=1e-12).y[:, -1]
    for i, name in enumerate(BEGAN):
        solved = np.array(states)[:, i]
        np.testing.assert_allclose(answer.column(name), solved, atol=EXACT)
        rms = np.sqrt(np.mean((run.column(name) - solved) ** 2))
        assert found["fit"][name]["rms"] == pytest.approx(rms, abs=EXACT)


def test_estimated_is_the_default_and_errs_least(rig, monkeypatch, capsys):
    squares = lambda found: sum(one["samples"] * one["rms_over_sigma"] ** 2 for one in found["fit"].values())
    found = {}
    for start in ("rest", "recorded", "estimated"):
        found[start] = squares(told(monkeypatch, capsys, rig, "--start", start, "--overwrite"))
    assert found["estimated"] < found["recorded"] < found["rest"]


def test_the_table_and_the_start_are_on_standard_output(rig, monkeypatch, capsys):
    code, said = simulated(monkeypatch, capsys, rig)
    assert code == 0
    assert "starts from the initial state estimated from the whole recording: x_rate " in said.out
    (line,) = [line for line in said.out.splitlines() if "│ x_rate" in line]
    assert "0.02" in line and "100" in line and "rms/σ" in said.out


def test_a_run_without_outputs_starts_at_rest_and_says_so(rig, monkeypatch, capsys):
    rewrite(rig, lambda columns: {"f": columns["f"]})
    code, said = simulated(monkeypatch, capsys, rig, run="changed.csv")
    assert code == 0 and "starts at rest" in said.out
    assert "no sample of x, x_rate" in said.err
    found = told(monkeypatch, capsys, rig, "--overwrite", run="changed.csv")
    assert found["start"] == "rest" and found["fit"] == {}
    assert [one["check"] for one in found["warnings"]] == ["initial-state"]


def test_one_of_two_channels_is_enough(rig, monkeypatch, capsys):
    """Claim: the position alone tells the initial rate; a channel without samples is in no table."""
    rewrite(rig, lambda columns: {name: columns[name] for name in ("f", "x")})
    found = told(monkeypatch, capsys, rig, run="changed.csv")
    assert [*found["fit"]] == ["x"]
    assert found["initial_state"] == pytest.approx(BEGAN, abs=0.2)


def late(columns):
    columns["x"][:30] = np.nan
    return columns


def test_a_sensor_that_starts_late_says_nothing_of_the_start(rig, monkeypatch, capsys):
    """Claim: its first value is refused as a recorded start, and an estimated one is right without it."""
    rewrite(rig, late)
    code, said = simulated(monkeypatch, capsys, rig, "--start", "recorded", run="changed.csv")
    assert code == 2 and "x has its first sample at 3 s" in said.err and "--start estimated" in said.err
    assert not (rig / "answer.csv").exists()
    found = told(monkeypatch, capsys, rig, run="changed.csv")
    assert found["initial_state"] == pytest.approx(BEGAN, abs=0.3)


def test_noise_that_nobody_states_has_no_ratio(rig, monkeypatch, capsys):
    text = (rig / "vehicle.toml").read_text(encoding="utf-8").replace("sigma = 0.02", 'sigma = "estimate"')
    (rig / "vehicle.toml").write_text(text, encoding="utf-8")
    found = told(monkeypatch, capsys, rig)["fit"]["x_rate"]
    assert found["sigma"] is None and found["rms_over_sigma"] is None and found["rms"] > 0.0
    assert "not stated" in simulated(monkeypatch, capsys, rig, "--overwrite")[1].out


def test_a_channel_that_cannot_be_used_is_no_missing_one(rig, monkeypatch, capsys):
    lines = (rig / "run.csv").read_text(encoding="utf-8").splitlines()
    header = lines[0].split(",")
    column = header.index("x")
    broken = [",".join("on" if i == column else cell for i, cell in enumerate(row.split(","))) for row in lines[1:]]
    (rig / "run.csv").write_text("\n".join([lines[0], *broken]), encoding="utf-8")
    code, said = simulated(monkeypatch, capsys, rig)
    assert code == 2 and "'x'" in said.err


def test_a_model_that_diverges_is_one_line_and_writes_nothing(rig, monkeypatch, capsys):
    text = (rig / "vehicle.toml").read_text(encoding="utf-8").replace("0.6", "-600.0")
    (rig / "vehicle.toml").write_text(text, encoding="utf-8")
    code, said = simulated(monkeypatch, capsys, rig)
    assert code == 2 and "diverges" in said.err and said.out == ""
    assert not (rig / "answer.csv").exists()
