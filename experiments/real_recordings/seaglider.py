"""Seaglider SG542, South Atlantic, 14 dives to 1000 m (public origin: GliderTools test data).

Baseline: surge and heave with linear damping, pitch and roll as recorded, VBD displacement as ballast, and a hull that
does not compress. The measured output is vertical speed from the pressure record.
"""

from pathlib import Path

import numpy as np
import pandas as pd

from jaxsub.recording import Recording

from ..data import data_folder

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


def vehicle_file(density: bool) -> str:
    """The baseline's vehicle file, with the recorded density as an input or without."""
    return VEHICLE.format(density='density = "rho"' if density else "")


def recordings() -> tuple[list[Recording], list[Recording]]:
    """Alternate dives to fit and to judge by."""
    folder = data_folder("seaglider_sg542")
    flight, ctd = pd.read_csv(folder / "flight.csv"), pd.read_csv(folder / "ctd.csv")
    ctd = ctd.set_index("time").loc[flight["time"]]
    flight["temperature"], flight["rho"] = ctd["temperature"].to_numpy(), ctd["rho_insitu"].to_numpy()
    dives = [_recording(str(number), rows) for number, rows in flight.groupby("dive")]
    return dives[::2], dives[1::2]


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
    """Diagnose with the density channel, and in `no_density` without it; the numbers in field units."""
    from .run import diagnose_files

    train, held = recordings()
    results = {}
    for label, density, folder in (("density", True, out), ("no_density", False, out / "no_density")):
        diagnosis, history = diagnose_files(vehicle_file(density), train, held, folder)
        results[label] = {
            "verdict": diagnosis.verdict,
            "summary": diagnosis.summary,
            "vertical_speed_rms_cm_s": {step: 100.0 * rms["depth_rate"] for step, rms in history.items()},
            "parameters": {found.label: field_units(found.parameters) for found in diagnosis.physics},
            "rivals": {found.label: {r.label: r.probability for r in found.rivals} for found in diagnosis.physics},
            "coefficients": {
                c.name: [c.improved.value, c.improved.standard_error] for c in diagnosis.coefficients if c.improved
            },
        }
    return results


def field_units(parameters: dict) -> dict:
    """Parameters as glider people write them: compressibility per dbar, expansion per °C."""
    units = {"kappa": (1e4, "1/dbar"), "alpha": (1.0, "1/degC"), "gamma": (1.0, "1/m"), "delta_B": (1.0, "N")}
    named = {}
    for symbol, estimate in parameters.items():
        factor, unit = units.get(symbol, (1.0, estimate.unit))
        named[symbol] = {
            "value": factor * estimate.value,
            "standard_error": factor * estimate.standard_error,
            "unit": unit,
        }
    return named
