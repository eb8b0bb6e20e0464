"""Seaglider SG542, South Atlantic, 14 dives to 1000 m (public origin: GliderTools test data).

Baseline: surge and heave with linear damping, pitch and roll as recorded, VBD displacement as ballast, and a hull that
does not compress. The measured output is vertical speed from the pressure record.
"""

from pathlib import Path

import numpy as np
import pandas as pd

from jaxsub.recording import Recording

from ..data import data_folder
from .case import Case
from .run import diagnose_case

_SURFACE = 15.0  # m; above it waves, communication and the air bladder act
VEHICLE = """
schema = 1
name = "Seaglider SG542"
kind = "submerged-body"
dof = ["surge", "heave"]
[body]
mass = 53.125                       # dives.csv, cal_mass
buoyancy = {{ value = 520.98, free = true }}   # hull displacement at the reference density, to be estimated
inertia = [1.0, 10.0, 10.0]
speed = 0.0                         # no cruise speed: buoyancy drives it
length = 1.8
diameter = 0.3
reference_density = 1027.5          # dives.csv, cal_rho0
[coefficients]
X_udot = {{ value = -3.0, fixed = true }}      # slender body: a twentieth of the mass
Z_wdot = {{ value = -50.0, fixed = true }}     # and about the mass itself across
X_u = {{ value = -4.0 }}
Z_w = {{ value = -60.0 }}
[prescribed]
theta = "theta"
phi = "phi"
z = "z"
[environment]
ballast = "vbd"
temperature = "T"
{density}
[outputs.depth_rate]
sigma = "estimate"
"""
PICKED = """
[[effects]]
effect = "quadratic-damping"
equation = "surge"
[[effects]]
effect = "hull-compressibility"
[[effects]]
effect = "thermal-expansion"
"""


def case(density: bool) -> Case:
    """Alternate dives to fit and to judge by, with the recorded density as an input or without."""
    folder = data_folder("seaglider_sg542")
    flight, ctd = pd.read_csv(folder / "flight.csv"), pd.read_csv(folder / "ctd.csv")
    ctd = ctd.set_index("time").loc[flight["time"]]
    flight["temperature"], flight["rho"] = ctd["temperature"].to_numpy(), ctd["rho_insitu"].to_numpy()
    dives = [_recording(str(number), rows) for number, rows in flight.groupby("dive")]
    return Case(
        vehicle=VEHICLE.format(density='density = "rho"' if density else ""),
        train=dives[::2],
        held=dives[1::2],
        prepared=(
            f"{len(dives)} dives below {_SURFACE:g} m, all samples (5 to 20 s); "
            "vertical speed by differences of depth; odd dives fitted, even ones held out"
        ),
        picked=PICKED,
        channels={"depth_rate": (100.0, "cm/s")},
        # compressibility per dbar and expansion per °C, as glider people write them
        parameters={
            "kappa": (1e4, "1/dbar"),
            "alpha": (1.0, "1/degC"),
            "gamma": (1.0, "1/m"),
            "X_u": (1.0, "N s/m"),
            "Z_w": (1.0, "N s/m"),
        },
    )


def _recording(name: str, rows: pd.DataFrame) -> Recording:
    t, depth = rows["time"].to_numpy(), rows["depth"].to_numpy()
    under = depth > _SURFACE
    inside = slice(int(np.argmax(under)), int(len(under) - np.argmax(under[::-1])))
    # salinity, and so density, is missing for some samples; an input may not have gaps
    density = np.interp(t, t[rows["rho"].notna()], rows["rho"].dropna().to_numpy())
    columns = {
        "theta": rows["pitch"].to_numpy(),
        "phi": rows["roll"].to_numpy(),
        "z": depth,
        "vbd": rows["vbd_cc"].to_numpy() * 1e-6,
        "T": rows["temperature"].to_numpy() + 273.15,
        "rho": density,
        "depth_rate": np.gradient(depth, t),
    }
    return Recording(
        f"dive {name}", t[inside] - t[0], {k: v[inside] for k, v in columns.items()}, f"flight.csv, dive {name}"
    )


def report(out: Path) -> dict:
    """Diagnose with the density channel, and in `no_density` without it."""
    return {
        "density": diagnose_case(case(True), out)[1],
        "no_density": diagnose_case(case(False), out / "no_density")[1],
    }
