"""Slocum glider comet, Baltic Sea 2016, dives to 42 m (public origin: Merckelbach et al., gliderflight).

Baseline: surge and heave with linear damping, pitch and roll as recorded, piston displacement as ballast, depth
measured. Once without density, as the set's task has it, and once with the CTD's.
"""

from pathlib import Path

import numpy as np
import pandas as pd

from jaxsub.recording import Recording

from ..data import data_folder
from .case import Case
from .run import diagnose_case

_SURFACE = 4.0  # m; above it waves and the air bladder act
_SHORTEST = 60  # samples of a dive that counts
VEHICLE = """
schema = 1
name = "Slocum comet"
kind = "submerged-body"
dof = ["surge", "heave"]
[body]
mass = 70.0                         # class value; the piston's zero is absorbed by the buoyancy below
buoyancy = {{ value = 686.5, free = true }}    # hull displacement at the reference density, to be estimated
inertia = [1.0, 15.0, 15.0]
speed = 0.0                         # no cruise speed: buoyancy drives it
length = 1.8
diameter = 0.22
reference_density = 1005.5          # middle of the water column
[coefficients]
X_udot = {{ value = -4.0, fixed = true }}      # slender body
Z_wdot = {{ value = -70.0, fixed = true }}
X_u = {{ value = -3.0, bounds = [-100.0, 0.0] }}
Z_w = {{ value = -80.0, bounds = [-1000.0, 0.0] }}
[inputs]
[prescribed]
theta = "theta"
phi = "phi"
[environment]
ballast = "ballast"
{density}
[outputs.depth]
sigma = "estimate"
"""
PICKED = """
[[effects]]
effect = "density-stratification"
"""


def case(density: bool) -> Case:
    """Alternate dives to fit and to judge by; with the density that the CTD recorded, or without."""
    folder = data_folder("slocum_comet2016")
    flight, ctd = pd.read_csv(folder / "flight.csv"), pd.read_csv(folder / "ctd.csv").dropna()
    flight["rho"] = np.interp(flight["time"], ctd["time"], ctd["density"])
    dives = _dives(flight)
    return Case(
        vehicle=VEHICLE.format(density='density = "rho"' if density else ""),
        train=dives[::2],
        held=dives[1::2],
        prepared=f"{len(dives)} dives below {_SURFACE:g} m, all samples (4.3 s); odd dives fitted, even ones held out",
        picked=PICKED,
        channels={"depth": (1.0, "m")},
        parameters={"kappa": (1e4, "1/dbar"), "X_u": (1.0, "N s/m"), "Z_w": (1.0, "N s/m")},
    )


def _dives(flight: pd.DataFrame) -> list[Recording]:
    under = (flight["depth"] > _SURFACE).to_numpy()
    edges = np.flatnonzero(np.diff(under.astype(int), prepend=0, append=0))
    spans = [(a, b) for a, b in edges.reshape(-1, 2) if b - a >= _SHORTEST]
    return [_recording(f"dive {number}", flight.iloc[a:b]) for number, (a, b) in enumerate(spans, 1)]


def _recording(name: str, rows: pd.DataFrame) -> Recording:
    columns = {"theta": "pitch", "phi": "roll", "ballast": "ballast_m3", "rho": "rho", "depth": "depth"}
    t = rows["time"].to_numpy()
    return Recording(name, t - t[0], {k: rows[v].to_numpy() for k, v in columns.items()}, f"flight.csv, {name}")


def report(out: Path) -> dict:
    """Diagnose without the density, and in `density` with it."""
    results = {}
    for label, density, folder in (("no_density", False, out), ("density", True, out / "density")):
        question = case(density)
        diagnosis, results[label] = diagnose_case(question, folder)
        rate = lambda model, o: np.gradient(model["depth"], o.times)
        for which in ("baseline", "improved"):
            errors = [rate(o.measured, o) - rate(getattr(o, which), o) for o in diagnosis.overlays]
            results[label][f"held_out_vertical_speed_rms_cm_s_{which}"] = 100.0 * float(
                np.sqrt(np.mean(np.concatenate(errors) ** 2))
            )
    return results
