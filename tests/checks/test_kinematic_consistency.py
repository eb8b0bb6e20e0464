"""Kinematics alone names a factor, a sign, an axis, a delay and a drift between channels."""

import numpy as np
import pytest
from check_cases import changed, clean, found, vehicle_named

from jaxsub.checks import check

KINDS = ("factor", "sign", "axis", "delay", "drift")
PAIRS = [
    ("nps", "psi", "r"), ("nps", "theta", "q"), ("remus", "theta", "q"), ("dsrv", "theta", "q"),
    ("oscillator", "x", "x_rate"), ("coupled", "b", "b_rate"), ("body", "psi", "r"), ("body", "theta", "q"),
]  # fmt: skip


def told(name, run):
    checked = check(vehicle_named(name), [run])
    return [finding for kind in KINDS for finding in found(checked, kind)]


@pytest.mark.parametrize(
    "name",
    [*("dsrv", "oscillator", "coupled", "body"), *(pytest.param(n, marks=pytest.mark.long) for n in ("nps", "remus"))],
)
def test_clean_runs_agree(name):
    for seed in range(10, 22):
        assert [finding.line() for finding in told(name, clean(name, seed))] == []


@pytest.mark.parametrize(("name", "channel", "rate"), PAIRS)
@pytest.mark.parametrize("seed", range(2))
def test_a_rate_in_degrees_is_named(name, channel, rate, seed):
    run = clean(name, seed)
    findings = told(name, changed(run, **{rate: np.rad2deg(run.columns[rate])}))
    assert [f.check for f in findings if f.channel == channel] == ["factor"]
    said = next(f for f in findings if f.channel == channel)
    assert said.severity == "error" and said.what.startswith(f"{rate} is ") and "degrees?" in said.what


@pytest.mark.parametrize(("name", "channel", "rate"), PAIRS)
def test_a_reversed_sign_is_named(name, channel, rate):
    run = clean(name)
    said = [f for f in told(name, changed(run, **{rate: -run.columns[rate]})) if f.channel == channel]
    assert [f.check for f in said] == ["sign"] and said[0].severity == "error" and "reversed" in said[0].what


@pytest.mark.parametrize("seed", range(6))
def test_millimetres_and_a_depth_that_points_up_are_named(seed):
    run = clean("dsrv", seed)
    (factor,) = told("dsrv", changed(run, w=run.columns["w"], z=run.columns["z"] / 1000.0))
    assert (factor.check, factor.channel) == ("factor", "z") and "such as mm?" in factor.what
    (sign,) = told("dsrv", changed(run, z=-run.columns["z"]))
    assert (sign.check, sign.channel) == ("sign", "z")


def test_swapped_rates_are_named():
    run = clean("nps", 1)
    findings = told("nps", changed(run, q=run.columns["r"], r=run.columns["q"]))
    assert [f.check for f in findings] == ["axis"] and "q" in findings[0].what and "r" in findings[0].what


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("late", ["theta", "q"])
def test_a_delay_between_sensors_is_named_in_seconds(seed, late):
    rows = int(np.random.default_rng(seed).integers(4, 15))
    run = clean("dsrv", seed)
    values = run.columns[late]
    (finding,) = told("dsrv", changed(run, **{late: np.concatenate([np.full(rows, values[0]), values[:-rows]])}))[:1]
    assert (finding.check, finding.severity) == ("delay", "warning") and finding.what.startswith(late)
    assert abs(float(finding.what.split()[2]) - 0.1 * rows) < 0.06, finding.what


@pytest.mark.parametrize("seed", range(4))
def test_a_drift_is_named(seed):
    run = clean("dsrv", seed)
    (finding,) = told("dsrv", changed(run, q=run.columns["q"] + 0.1))
    assert (finding.check, finding.channel) == ("drift", "theta")


@pytest.mark.parametrize("factor", [180.0 / np.pi, -1.0])
def test_a_steady_turn_in_degrees_or_reversed_is_named(factor):
    noise = 0.0035 * np.random.default_rng(0).standard_normal(600)
    run = clean("nps")
    psi = 0.1 * run.times + 0.005 * np.random.default_rng(1).standard_normal(600)
    zero = 0.001 * np.random.default_rng(2).standard_normal((4, 600))
    quiet = dict(zip(("phi", "theta", "p", "q"), zero, strict=True))
    findings = told("nps", changed(run, psi=psi, r=factor * (0.1 + noise), **quiet))
    assert [f.check for f in findings if f.channel == "psi"] == ["factor" if factor > 1.0 else "sign"]
    assert not [f for f in told("nps", changed(run, psi=psi, r=0.1 + noise, **quiet)) if f.channel == "psi"]
