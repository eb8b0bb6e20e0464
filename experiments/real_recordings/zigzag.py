"""KVLCC2 free-running zigzags of a 7 m model, HSVA 2006 (public origin: SIMMAN 2008; Alexandersson et al. 2022).

Baseline: surge, sway, roll and yaw, linear at the approach speed, added masses held at the MMG paper's values.
Measured rudder and effective thrust are inputs; surge and sway velocity, yaw rate and roll angle are measured.
Turning circles (MARIN) are not among the recordings here, so no advance or tactical diameter can be judged.
"""

from pathlib import Path

import numpy as np
import pandas as pd

from jaxsub.discrepancy import Conclusions
from jaxsub.recording import Recording

from ..data import data_folder
from .case import DEGREES, Case
from .preparation import held_means
from .run import diagnose_case

_EVERY = 5  # 20 Hz to 4 Hz: ten samples in a roll period
_ARM = 0.2436  # m, midships to centre of gravity
_SIDES = {"Z_10_01", "Z_10_05", "Z_10_10_S", "Z_20_05", "Z_25_05", "Z_35_05"}  # fitted; the other kinds are held out
VEHICLE = """
schema = 1
name = "KVLCC2, 7 m model"
kind = "submerged-body"
dof = ["surge", "sway", "roll", "yaw"]
[body]
mass = 3272.0                       # ship_data_hsva.yml
inertia = [840.0, 9908.6, 9908.6]   # roll radius of gyration 0.40 B
centre_of_buoyancy = [0.0, 0.0, { value = -0.125, free = true, bounds = [-0.5, -0.02] }]   # metacentre above gravity
speed = 1.179
length = 7.0
diameter = 0.455                    # draught
reference_density = 1000.0
[coefficients]
X_udot = { value = -245.0, fixed = true }      # MMG paper, m_x' = 0.022
Y_vdot = { value = -2486.0, fixed = true }     # m_y' = 0.223
N_rdot = { value = -6008.0, fixed = true }     # J_zz' = 0.011
K_pdot = { value = -170.0, fixed = true }      # a fifth of the inertia
X_u = { value = -60.0 }
X_0 = { value = 35.0 }
Y_v = { value = -630.0 }
Y_r = { value = 1270.0 }
N_v = { value = -940.0 }
N_r = { value = -4600.0 }
K_p = { value = -150.0 }
K_v = { value = 0.0 }
K_r = { value = 0.0 }
Y_delta_r = { value = 106.0 }                  # positive rudder steers to port
N_delta_r = { value = -400.0 }
K_delta_r = { value = 0.0 }
[inputs]
rudder = "delta"
thrust = "thrust"
[outputs.u]
sigma = "estimate"
[outputs.v]
sigma = "estimate"
[outputs.r]
sigma = "estimate"
[outputs.phi]
sigma = "estimate"
"""
PICKED = """
[[effects]]
effect = "coriolis-coupling"
equations = ["surge", "sway", "roll", "yaw"]
[[effects]]
effect = "crossflow-drag"
plane = "horizontal"
length = 7.0
diameter = 0.455
[[effects]]
effect = "turning-speed-loss"
first = "sway"
second = "yaw"
[[effects]]
effect = "speed-scaling"
equation = "sway"
with = "sway"
[[effects]]
effect = "speed-scaling"
equation = "sway"
with = "yaw"
[[effects]]
effect = "speed-scaling"
equation = "sway"
with = "rudder"
[[effects]]
effect = "speed-scaling"
equation = "yaw"
with = "sway"
[[effects]]
effect = "speed-scaling"
equation = "yaw"
with = "yaw"
[[effects]]
effect = "speed-scaling"
equation = "yaw"
with = "rudder"
"""


def case() -> Case:
    """Six kinds of zigzag to fit; 5/1, 15/1, 15/5, 20/10 and 30/5 and a 10/10 to the other side to judge by."""
    rows = pd.read_csv(data_folder("kvlcc2_freerunning") / "hsva_zigzag.csv")
    runs = [_recording(str(name), group) for name, group in rows.groupby("run")]
    return Case(
        vehicle=VEHICLE,
        train=[run for run in runs if run.name in _SIDES],
        held=[run for run in runs if run.name not in _SIDES],
        prepared=(
            "every 5th sample (20 Hz to 4 Hz), rudder and thrust averaged over the interval they are held for; sway "
            "velocity moved from midships to the centre of gravity; thrust less a deduction of 0.25"
        ),
        picked=PICKED,
        channels={"u": (1.0, "m/s"), "v": (1.0, "m/s"), "r": (DEGREES, "deg/s"), "phi": (DEGREES, "deg")},
        published={
            "turning circle from zigzags, advance (Alexandersson 2022)": "within 2 %; no circle among the recordings",
            "tactical diameter": "2-6 %; no circle among the recordings",
        },
    )


def _recording(name: str, rows: pd.DataFrame) -> Recording:
    taken = rows.iloc[::_EVERY]
    columns = {
        "delta": held_means(rows["delta"].to_numpy(), _EVERY),
        "thrust": 0.75 * held_means(rows["thrust"].to_numpy(), _EVERY),
        "u": taken["u"].to_numpy(),
        "v": (taken["v"] + _ARM * taken["r"]).to_numpy(),
        "r": taken["r"].to_numpy(),
        "phi": taken["phi"].to_numpy(),
    }
    return Recording(name, taken["t"].to_numpy(), columns, f"hsva_zigzag.csv, {name}")


def report(out: Path) -> dict:
    """Diagnose, and the share of each channel that simulation of the test zigzags explains."""
    question = case()
    diagnosis, results = diagnose_case(question, out)
    results["held_out_fit_percent"] = {which: fit_percent(diagnosis, which) for which in ("baseline", "improved")}
    return results


def fit_percent(diagnosis: Conclusions, which: str) -> dict[str, float]:
    r"""$100(1-\lVert y-\hat y\rVert/\lVert y-\bar y\rVert)$ by channel over all test runs."""
    found = {}
    for channel in diagnosis.overlays[0].measured:
        measured = [o.measured[channel] for o in diagnosis.overlays]
        model = [getattr(o, which)[channel] for o in diagnosis.overlays]
        missed = np.linalg.norm(np.concatenate(measured) - np.concatenate(model))
        about_mean = np.linalg.norm(np.concatenate([y - y.mean() for y in measured]))
        found[channel] = 100.0 * (1.0 - float(missed / about_mean))
    return found
