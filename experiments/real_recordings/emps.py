"""EMPS, an electro-mechanical positioning system (public origin: Janot, Gautier and Brunot 2019, nonlinear benchmark).

One coordinate: drive voltage in, carriage position out, linear friction as baseline; trained on the smooth run, tested
by free-run simulation on the run with pulses. The force per volt is the published 35.15 N/V.
"""

from pathlib import Path

import pandas as pd

from jaxsub.recording import Recording

from ..data import data_folder
from .run import diagnose_files

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


def recording(file: str) -> Recording:
    """One of the two runs, 1 kHz."""
    rows = pd.read_parquet(data_folder("emps") / f"{file}.parquet")
    columns = {"u": rows["u_vir_V"].to_numpy(), "q": rows["y_q_m"].to_numpy()}
    return Recording(file, rows["t_s"].to_numpy(), columns, f"{file}.parquet")


def report(out: Path) -> dict:
    """Diagnose on the training run, judge on the pulses."""
    train, test = recording("emps_train"), recording("emps_test_pulses")
    diagnosis, history = diagnose_files(VEHICLE, [train], [test], out)
    return {
        "verdict": diagnosis.verdict,
        "summary": diagnosis.summary,
        "test_simulation_rmse_mm": {step: 1e3 * rms["q"] for step, rms in history.items()},
        "published_rmse_mm": {"linear": 5.53, "CT SUBNET": 4.61, "dynoNet": 2.64},
        "parameters": {
            found.label: {s: [e.value, e.standard_error] for s, e in found.parameters.items()}
            for found in diagnosis.physics
        },
        "coefficients": {
            c.name: [c.improved.value, c.improved.standard_error] for c in diagnosis.coefficients if c.improved
        },
    }
