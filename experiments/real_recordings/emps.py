"""EMPS, an electro-mechanical positioning system (public origin: Janot, Gautier and Brunot 2019, nonlinear benchmark).

One coordinate: drive voltage in, carriage position out, linear friction as baseline; trained on the smooth run, tested
by open-loop simulation of the run with pulses. The force per volt is the published 35.15 N/V.
"""

from pathlib import Path

import pandas as pd

from jaxsub.recording import Recording

from ..data import data_folder
from .case import Case
from .preparation import held_means
from .run import diagnose_case

_EVERY = 10  # 1 kHz to 100 Hz; voltage changes within it act by their mean
VEHICLE = """
schema = 1
name = "EMPS"
kind = "mechanism"
dof = ["q"]
[coefficients]
I_q = { value = 90.0, bounds = [20.0, 400.0] }      # carriage mass, kg
D_q = { value = 300.0, bounds = [0.0, 3000.0] }     # viscous friction, N s/m
B_q_drive = { value = 35.15065188248547, fixed = true }   # N/V
[inputs]
drive = "u"
[outputs.q]
sigma = "estimate"
"""
PICKED = """
[[effects]]
effect = "coulomb-friction"
equation = "q"
smoothing = 0.002
"""


def recording(file: str) -> Recording:
    """One of the two runs."""
    rows = pd.read_parquet(data_folder("emps") / f"{file}.parquet")
    taken = rows.iloc[::_EVERY]
    columns = {"u": held_means(rows["u_vir_V"].to_numpy(), _EVERY), "q": taken["y_q_m"].to_numpy()}
    return Recording(file, taken["t_s"].to_numpy(), columns, f"{file}.parquet")


def case() -> Case:
    """The benchmark's own split."""
    return Case(
        vehicle=VEHICLE,
        train=[recording("emps_train")],
        held=[recording("emps_test_pulses")],
        prepared="every 10th sample (1 kHz to 100 Hz), voltage averaged over the interval it is held for",
        picked=PICKED,
        channels={"q": (1e3, "mm")},
        parameters={"F_0": (1.0, "N"), "F_c": (1.0, "N"), "I_q": (1.0, "kg"), "D_q": (1.0, "N s/m")},
        published={"linear, mm": 5.53, "CT SUBNET, mm": 4.61, "dynoNet, mm": 2.64},
    )


def report(out: Path) -> dict:
    """Diagnose on the training run, judge on the pulses."""
    return diagnose_case(case(), out)[1]
