"""KVLCC2 roll-decay tests of a 1:68 model, SSPA 2018 (public origin: Alexandersson et al., Ikeda's method study).

One coordinate, linear damping as baseline, at zero speed and at 15.5 kn full scale. Each run is cut to its free decay;
its first 70 % is fitted, the rest held out. Inertia is scaled to 1, so damping is in 1/s and stiffness in 1/s².
"""

from pathlib import Path

import pandas as pd

from jaxsub.recording import Recording, split

from ..data import data_folder
from .run import diagnose_files

VEHICLE = """
schema = 1
name = "KVLCC2 roll decay, {speed}"
kind = "mechanism"
dof = ["phi"]
[coefficients]
I_phi = {{ value = 1.0, fixed = true }}
D_phi = {{ value = 0.05 }}
K_phi = {{ value = 6.3 }}
F_phi = {{ value = 0.001 }}
[outputs.phi]
sigma = "estimate"
"""
# free decay: from the first extreme after release to where the model stops or is caught, s
RUNS = {"0 kn": ("21337", 26.5, 91.0), "15.5 kn": ("21340", 24.5, 77.0)}


def report(out: Path) -> dict:
    """Diagnose both speeds, in a folder each."""
    results = {}
    for speed, (number, start, end) in RUNS.items():
        rows = pd.read_csv(data_folder("kvlcc2_rolldecay") / f"model_test_{number}.csv")
        name = f"model_test_{number}"
        whole = Recording(name, rows["time"].to_numpy(), {"phi": rows["phi"].to_numpy()}, f"{name}.csv")
        train, held = split(whole.between(start, end))
        folder = out / speed.replace(" ", "_")
        diagnosis, history = diagnose_files(VEHICLE.format(speed=speed), [train], [held], folder)
        results[speed] = {
            "verdict": diagnosis.verdict,
            "summary": diagnosis.summary,
            "held_out_rms_deg": {step: 57.29578 * rms["phi"] for step, rms in history.items()},
            "parameters": {
                found.label: {s: [e.value, e.standard_error] for s, e in found.parameters.items()}
                for found in diagnosis.physics
            },
            "rivals": {found.label: {r.label: r.probability for r in found.rivals} for found in diagnosis.physics},
        }
    return results
