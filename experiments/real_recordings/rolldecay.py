"""KVLCC2 roll-decay tests of a 1:68 model, SSPA 2018 (public origin: Alexandersson et al., Ikeda's method study).

One coordinate, linear damping as baseline, at zero speed and at 15.5 kn full scale. Each run is cut to its free decay;
its first 70 % is fitted, the rest held out. Inertia is scaled to 1, so damping is in 1/s and stiffness in 1/s².
"""

from pathlib import Path

import pandas as pd

from jaxsub.recording import Recording, split

from ..data import data_folder
from .case import DEGREES, Case
from .run import diagnose_case

_EVERY = 5  # 100 Hz to 20 Hz: fifty samples in a roll period
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
PICKED = """
[[effects]]
effect = "quadratic-damping"
equation = "phi"
[[effects]]
effect = "cubic-stiffness"
equation = "phi"
"""
# free decay: from the first extreme after release to where the model stops or is caught, s
RUNS = {"0 kn": ("21337", 26.5, 91.0), "15.5 kn": ("21340", 24.5, 77.0)}
# of moments over the roll inertia, added inertia included
_UNITS = {
    "D_phi": (1.0, "1/s"),
    "K_phi": (1.0, "1/s^2"),
    "F_phi": (1.0, "rad/s^2"),
    "D2_phi": (1.0, "1/rad"),
    "D3_phi": (1.0, "s/rad^2"),
    "k_3": (1.0, "1/(s^2 rad^2)"),
}


def case(speed: str) -> Case:
    """The decay at one speed."""
    number, start, end = RUNS[speed]
    name = f"model_test_{number}"
    rows = pd.read_csv(data_folder("kvlcc2_rolldecay") / f"{name}.csv").iloc[::_EVERY]
    whole = Recording(name, rows["time"].to_numpy(), {"phi": rows["phi"].to_numpy()}, f"{name}.csv")
    train, held = split(whole.between(start, end))
    return Case(
        vehicle=VEHICLE.format(speed=speed),
        train=[train],
        held=[held],
        prepared=f"free decay from {start:g} to {end:g} s, every 5th sample (20 Hz); first 70 % fitted, rest held out",
        picked=PICKED,
        channels={"phi": (DEGREES, "deg")},
        parameters=_UNITS,
    )


def report(out: Path) -> dict:
    """Diagnose both speeds, in a folder each."""
    return {speed: diagnose_case(case(speed), out / speed.replace(" ", "_"))[1] for speed in RUNS}
