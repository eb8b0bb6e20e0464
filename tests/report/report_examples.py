"""Diagnoses as a six-degree-of-freedom vehicle would give them, one for each verdict, made up but of realistic size."""

import dataclasses

import numpy as np
from report_traces import BEFORE, CHANNELS, COEFFICIENTS, overlay, trace

from jaxsub.discrepancy.records.diagnosis import (
    Candidate,
    ChannelQuality,
    Coefficient,
    Conclusions,
    Explained,
    Gain,
    Location,
    ParameterEstimate,
    Physics,
    Regime,
    Remainder,
    Rival,
    RunQuality,
)
from jaxsub.findings import Finding

VEHICLE = """schema = 1
name = "NPS AUV II"
kind = "submerged-body"

[coefficients]
Y_v = { value = -2431.0 }

[[effects]]
effect = "crossflow-drag"
plane = "horizontal"
length = 5.3
diameter = 0.4
expression = "-½ρD C_d ∫ (1, x) |v + x r|(v + x r) dx"

[effects.parameters]
C_d = { value = 0.6137, bounds = [0.0, inf] }
"""


FINDINGS = (
    Finding(
        "sentinel", "warning", "runs/zigzag-2.csv", "100 samples (8.3 %) of -32.768 masked as a sentinel",
        "check the logger", "z", ((120, 219),), ((11.8, 21.7),), 100,
    ),
    Finding("header-row", "note", "runs/turns-1.csv", "row 2 was read as the units of the columns"),
)  # fmt: skip


def diagnosis(verdict: str = "named", seed: int = 7, samples: int = 1200, described: bool = False) -> Conclusions:
    """A diagnosis with two fitted runs and a held-out one; `described` says that effects without a name stand in."""
    make = np.random.default_rng(seed)
    accepted = verdict in ("named", "ambiguous")
    found = accepted or described
    missing = verdict != "none"
    fit, models = _fit(missing, found), ("baseline", "improved")[: 1 + found]
    return Conclusions(
        verdict=verdict,
        vehicle="NPS AUV II",
        summary=_SUMMARIES[verdict],
        p_value=0.0 if missing else 0.43,
        where=_places() if missing else [],
        physics=[_physics(verdict)] if accepted else [],
        fit=fit,
        history=[(model, fit["held_out"][model]) for model in models],
        candidates=_candidates(verdict),
        forces=[trace(make, run, samples, float(missing)) for run in ("turns-1", "zigzag-2")],
        remaining_forces=[trace(make, run, samples, 0.0, 1.0) for run in ("turns-1", "zigzag-2")] if found else [],
        overlays=[overlay(make, samples, missing, found)],
        coefficients=_coefficients(make, found),
        channels=[
            ChannelQuality(name, unit, samples * 3, 0.02 if name == "z" else 0.0, sigma, name == "w",
                           sigma * (2.1 if name == "p" else make.uniform(0.9, 1.1)))
            for name, (unit, sigma, _) in CHANNELS.items()
        ],
        runs=[
            RunQuality("turns-1", "train", 119.9, samples, 0.1, 0.1),
            RunQuality("zigzag-2", "train", 119.9, samples, 0.1, 0.6),
            RunQuality("turns-3", "held out", 119.9, samples, 0.1, 0.1),
        ],
        notes=["The noise recorded in p is twice the stated one.", "Heave was hardly excited: |w| < 0.05 m/s."],
        next_manoeuvre=_NEXT if verdict == "ambiguous" else None,
        remains={model: _remains(make, model, missing) for model in models},
        gain=Gain(0.12, 0.0005) if found else None,
        kinds={"structure": 0.9712, "disturbance": 0.0288, "sensor": 3e-12} if missing else {"disturbance": 1.0},
        file_p_value=3.2e-9,
        explained=Explained(0.97 if found else None, {}),
        findings=FINDINGS,
    )  # fmt: skip


def bare(verdict: str = "none") -> Conclusions:
    """The least that a diagnosis can hold."""
    empty = {field.name: [] for field in dataclasses.fields(Conclusions) if str(field.type).startswith("list")}
    return Conclusions(verdict=verdict, vehicle="rig", summary="-", p_value=1.0, fit={}, next_manoeuvre=None, **empty)


_NEXT = "A turning circle at 20° rudder and half the speed: the drag would fall fourfold, the lift only twofold."
_SUMMARIES = {
    "none": "The model explains the recordings: no force, actuator or sensor error stands out of the noise.",
    "named": "The model lacks crossflow drag in sway and yaw (C_d = 0.614 ± 0.021): it removes 97 % of the mismatch "
    "on the run that was held out.",
    "ambiguous": "The model lacks a force in sway and yaw that grows with sway velocity; crossflow drag and quadratic "
    "damping explain it equally well.",
    "unknown": "The model lacks a force in sway and yaw that grows with |v| and with time; no effect in the vocabulary "
    "explains it.",
}


def _places() -> list[Location]:
    times = [("turns-1", 12.0, 31.5), ("turns-1", 48.2, 77.04), ("zigzag-2", 20.0, 95.5)]
    return [
        Location("sway", 0.71, times, ["abs(v)", "r", "delta_r"], Regime("abs(r)", True, 0.1234, 0.81, 0.06, "rad/s")),
        Location("yaw", 0.24, times[1:], ["abs(r)", "v"]),
        Location("sensor:psi", 0.05, [], []),
    ]


def _physics(verdict: str) -> Physics:
    sure = verdict == "named"
    rivals = [
        Rival("quadratic-damping", "quadratic-damping[sway]", 0.021 if sure else 0.41),
        Rival("turning-speed-loss", "turning-speed-loss[v,r]", 0.0004 if sure else 0.06),
    ]
    return Physics(
        "crossflow-drag", "crossflow-drag[horizontal]", ["sway", "yaw"], "-½ρD C_d ∫ (1, x) |v + x r|(v + x r) dx",
        0.978 if sure else 0.53, {"C_d": ParameterEstimate(0.61372, 0.0214, "1")}, rivals,
        {"Y_v": -0.973},
    )  # fmt: skip


def _candidates(verdict: str) -> list[Candidate]:
    scale = {"none": 2e-4, "unknown": 0.02}.get(verdict, 1.0)
    rows = (
        ("crossflow-drag", "[horizontal]", 48211.0, 1, {"C_d": 0.583}, 0.64, "accepted"),
        ("quadratic-damping", "[sway]", 41870.0, 1, {"Y_vv": -1830.0}, 0.41, "refitted: worse by 812 on unseen runs"),
        ("quadratic-damping", "[yaw]", 20211.0, 1, {"N_rr": -9120.0}, 0.37, "refitted: worse by 9120"),
        ("turning-speed-loss", "[v,r]", 5120.0, 1, {"X_vr": 512.0}, 0.88, "explained once drag is in"),
        ("speed-scaling", "[sway,v]", 2210.0, 1, {"Y_uv": -12.0}, 0.12, "explained once drag is in"),
        ("trim-offset", "", 410.0, 3, {"x_B": 0.0012, "y_B": -4e-4, "z_B": 3.2e-5}, 0.72, "explained once drag is in"),
        ("current", "", 220.0, 2, {"V_N": 0.03, "V_E": -0.11}, 0.55, "explained once drag is in"),
        ("actuator-lag", "[rudder]", 98.0, 1, {"T": 0.08}, 0.31, "not significant"),
        ("sensor-bias", "[psi]", 31.0, 1, {"bias": 0.0021}, 0.99, "not significant"),
        ("propeller-torque", "[constant]", 3.1, 1, {"K_Q": 0.4}, 0.9, "not significant"),
    )  # fmt: skip
    outcome = {"none": "not significant", "unknown": "rejected: no gain on unseen runs"}
    return [
        Candidate(effect, effect + form, chi * scale, dof, min(1.0, 40.0 * np.exp(-chi * scale / 2)), sizes, kept,
                  outcome.get(verdict, text))
        for effect, form, chi, dof, sizes, kept, text in rows
    ]  # fmt: skip


def _fit(missing: bool, found: bool) -> dict[str, dict[str, dict[str, float]]]:
    before = {name: BEFORE.get(name, 1.01) if missing else 0.97 + 0.01 * len(name) for name in CHANNELS}
    after = {name: 1.0 + 0.03 * np.log(value) for name, value in before.items()} if found else before
    worse = {name: 1.08 * value for name, value in before.items()}
    return {
        "train": {"baseline": before, "improved": after},
        "held_out": {"baseline": worse, "improved": {n: 1.02 * v for n, v in after.items()} if found else worse},
    }


def _remains(make: np.random.Generator, model: str, missing: bool) -> dict[str, Remainder]:
    """The baseline leaves what goes with itself and the rudder in some channels, the improved model noise."""
    left = {}
    for name in CHANNELS:
        slow = 0.8 if model == "baseline" and missing and name in BEFORE else 0.0
        lagged = slow ** np.arange(1, 61) + 0.02 * make.normal(size=60)
        inputs = {one: make.normal(size=121) + 9.0 * slow * np.exp(-np.abs(np.arange(-60, 61)) / 9.0)
                  for one in ("rudder", "stern planes")}  # fmt: skip
        rms = BEFORE.get(name, 1.01) if slow else 1.0
        random, independent = (1e-40, 1e-9) if slow else (0.4, 1.0)
        delays = 0.2 * np.arange(1, 61)
        left[name] = Remainder(0.9 * rms, 1.1 * rms, 1200, delays, lagged, random, inputs, "rudder", independent)
    return left


def _coefficients(make: np.random.Generator, found: bool) -> list[Coefficient]:
    rows = []
    for name, unit, start, value, error in COEFFICIENTS:
        after = value + (make.normal() * error if abs(value / start - 1) < 0.1 else 0.95 * (start - value))
        improved = ParameterEstimate(after if np.isfinite(after) else value, error * 1.2, unit) if found else None
        verdict = "not excited" if np.isinf(error) else "weak" if error > abs(value) / 2 else "identified"
        rows.append(Coefficient(name, unit, start, ParameterEstimate(value, error, unit), improved, verdict))
    return rows
