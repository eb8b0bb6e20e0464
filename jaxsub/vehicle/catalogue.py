"""Published vehicles, most of them linearised about their operating speed.

Numbers are published ones; only the scaling to SI and the linearisation happen here. What the grammar of vehicle files
says as it was published is a file in `published`. Sensor noise is that of a usual suite.
"""

from pathlib import Path
from typing import Any

from .mechanism import Mechanism
from .read import read_vehicle, vehicle_from
from .submerged_body import SubmergedBody
from .usual_sensors import OUTPUTS

_FORCES, _MOMENTS, _LINES, _TURNS = "XYZ", "KMN", "uvw", "pqr"
_FINS = {"rudder": "delta_r", "elevator_right": "delta_er", "elevator_left": "delta_el"}


def dimensional(prime: dict[str, float], length: float, speed: float, density: float) -> dict[str, float]:
    r"""SI coefficients from prime ones: $\tfrac12\rho L^a U^b$ with a and b from the name.

    A force derivative by a translational acceleration scales with $\tfrac12\rho L^3$; each moment, each rotational
    variable adds one power of L; a velocity derivative has one L less and one U more, a fin's two of each.
    """
    scaled = {}
    for name, value in prime.items():
        variable = name[2:]
        powers = 3 + (name[0] in _MOMENTS) + (variable[0] in _TURNS)
        if variable.startswith("delta"):
            powers, speeds = 2 + (name[0] in _MOMENTS), 2
        elif variable.endswith("dot"):
            speeds = 0
        else:
            powers, speeds = powers - 1, 1
        scaled[name] = value * 0.5 * density * length**powers * speed**speeds
    return scaled


def _coefficients(values: dict[str, float]) -> dict[str, Any]:
    """A file's `[coefficients]`: damping and control free, added mass fixed as it would be from a panel code."""
    return {name: {"value": value, "fixed": name.endswith("dot")} for name, value in values.items()}


def nps_auv_ii() -> SubmergedBody:
    """NPS AUV II (L = 5.3 m) at 1.832 m/s, all six degrees of freedom.

    Healey and Lienard (1993), IEEE J. Oceanic Eng. 18(3), with the original fresh-water density of 1000 kg/m³ and
    mass of 5454.54 kg; the copy in Fossen's MSS (npsauv.m) scales the same prime values with 1025 kg/m³. Surge drag is
    C_d0 = 0.00385 linearised at U_c. The stern plane is taken as two halves 0.35 m off the centre line, which gives the
    roll coefficients `K_delta_er` and `K_delta_el`: the publication deflects both together and has none.
    """
    length, speed, density = 5.3, 1.832, 1000.0
    prime = {
        "X_udot": -0.0076, "Y_vdot": -0.055, "Y_pdot": 1.2e-4, "Y_rdot": 1.2e-3, "Z_wdot": -0.24, "Z_qdot": -0.0068,
        "K_vdot": 1.2e-4, "K_pdot": -1.0e-3, "K_rdot": -3.4e-5, "M_wdot": -0.0068, "M_qdot": -0.017,
        "N_vdot": 1.2e-3, "N_pdot": -3.4e-5, "N_rdot": -0.0034,
        "X_u": -2.0 * 0.00385, "Y_v": -0.1, "Y_p": 0.003, "Y_r": 0.03, "Z_w": -0.3, "Z_q": -0.14,
        "K_v": 0.0031, "K_p": -0.011, "K_r": -0.00084, "M_w": 0.1, "M_q": -0.068, "N_v": -0.0074, "N_p": -0.00084,
        "N_r": -0.016, "Y_delta_r": 0.027, "N_delta_r": -0.013, "Z_delta_e": -0.073, "M_delta_e": -0.041,
    }  # fmt: skip
    values = dimensional(prime, length, speed, density)
    values["X_0"] = -values["X_u"] * speed
    values |= dict.fromkeys(("K_delta_er", "K_delta_el"), 0.35 * values["Z_delta_e"] / 2.0)
    return _submerged_body({
        "schema": 1,
        "name": "NPS AUV II",
        "kind": "submerged-body",
        "body": {
            "mass": 5454.54, "weight": 53400.0, "buoyancy": 53400.0, "inertia": [2038.0, 13587.0, 13587.0],
            "centre_of_buoyancy": [0.0, 0.0, -0.061], "speed": speed, "length": length, "reference_density": density,
        },
        "coefficients": _coefficients(values),
        "inputs": _FINS,
        "outputs": OUTPUTS,
    })  # fmt: skip


def remus_100() -> SubmergedBody:
    """REMUS 100 at 1.54 m/s, all six degrees of freedom.

    Prestero (2001), MIT thesis, as it circulates in public code. Where copies disagree: `N_uudr` is taken as -6.15
    (a stern rudder that pushes to starboard turns the bow to port), `K_pdot` as -0.0704, `M_uw` as 24.0, buoyancy as
    306 N, and roll damping as |p|p coefficient -0.13 linearised at 1 rad/s. The quadratic terms `Y_vv`, `Z_ww`,
    `M_qq`, `N_rr` on which copies disagree are left out: a linear model has none.

    As published and linearised (restoring left out), sway-yaw and heave-pitch are unstable in open loop, with a
    largest eigenvalue of about +1.0 1/s: errors grow e-fold every second, so free-running fits need short runs.
    """
    speed = 1.54
    values = {
        "X_udot": -0.93, "Y_vdot": -35.5, "Y_rdot": 1.93, "Z_wdot": -35.5, "Z_qdot": -1.93, "K_pdot": -0.0704,
        "M_wdot": -1.93, "M_qdot": -4.88, "N_vdot": 1.93, "N_rdot": -4.88,
        "X_u": 2.0 * -1.62 * speed, "Y_v": -28.6 * speed, "Y_r": 5.22 * speed, "Z_w": -28.6 * speed,
        "Z_q": -5.22 * speed, "K_p": -0.13, "M_w": 24.0 * speed, "M_q": -2.0 * speed, "N_v": -24.0 * speed,
        "N_r": -2.0 * speed, "Y_delta_r": 9.64 * speed**2, "N_delta_r": -6.15 * speed**2,
        "Z_delta_s": -9.64 * speed**2, "M_delta_s": -6.15 * speed**2,
    }  # fmt: skip
    values["X_0"] = -values["X_u"] * speed
    return _submerged_body({
        "schema": 1,
        "name": "REMUS 100",
        "kind": "submerged-body",
        "body": {
            "mass": 299.0 / 9.81, "weight": 299.0, "buoyancy": 306.0, "inertia": [0.177, 3.45, 3.45],
            "centre_of_buoyancy": [0.0, 0.0, -0.0196], "speed": speed, "length": 1.33, "diameter": 0.191,
        },
        "coefficients": _coefficients(values),
        "inputs": {"rudder": "delta_r", "stern_plane": "delta_s"},
        "outputs": OUTPUTS,
    })  # fmt: skip


def remus_100_nonlinear() -> SubmergedBody:
    """REMUS 100 with the nonlinear derivatives of Prestero (2001), all six degrees of freedom: a vehicle file."""
    return _published("remus_100")


def bluerov2_heavy() -> SubmergedBody:
    """BlueROV2 Heavy of von Benzon et al. (2022), six degrees of freedom and eight thrusters: a vehicle file."""
    return _published("bluerov2_heavy")


def kvlcc2() -> SubmergedBody:
    """The KVLCC2 tanker's 7 m model by the MMG method of Yasukawa and Yoshimura (2015): a vehicle file."""
    return _published("kvlcc2")


def dsrv() -> SubmergedBody:
    """Deep Submergence Rescue Vehicle, heave and pitch at 4.11 m/s.

    Healey (1992) as in Fossen's MSS (DSRV.m): prime values with L = 5.0 m, scaled here with 1025 kg/m³. Its
    `Z_qdot` (-0.00013) and `M_wdot` (-0.000146) differ and are kept as printed. The restoring moment is not among
    the published numbers at hand and is left at zero.
    """
    length, speed, density = 5.0, 4.11, 1025.0
    prime = {
        "Z_wdot": -0.031545, "Z_qdot": -0.00013, "M_wdot": -0.000146, "M_qdot": -0.001573, "Z_w": -0.043938,
        "Z_q": -0.017455, "M_w": 0.011175, "M_q": -0.01131, "Z_delta_s": 0.027695, "M_delta_s": -0.012797,
    }  # fmt: skip
    inertia = 0.001925 * 0.5 * density * length**5
    return _submerged_body({
        "schema": 1,
        "name": "DSRV",
        "kind": "submerged-body",
        "dof": ["heave", "pitch"],
        "body": {
            "mass": 0.036391 * 0.5 * density * length**3, "inertia": [inertia, inertia, inertia], "speed": speed,
            "length": length,
        },
        "coefficients": _coefficients(dimensional(prime, length, speed, density)),
        "inputs": {"stern_plane": "delta_s"},
        "outputs": {name: OUTPUTS[name] for name in ("w", "q", "theta", "z")},
    })  # fmt: skip


def otter() -> SubmergedBody:
    """Otter USV of Fossen's simulators, in surge, sway and yaw, with two propellers: a vehicle file."""
    return _published("otter")


def _published(name: str) -> SubmergedBody:
    vehicle = read_vehicle(Path(__file__).parent / "published" / f"{name}.toml")
    assert isinstance(vehicle, SubmergedBody)
    return vehicle


def _submerged_body(data: dict[str, Any]) -> SubmergedBody:
    vehicle: SubmergedBody | Mechanism = vehicle_from(data, f"catalogue: {data['name']}")
    assert isinstance(vehicle, SubmergedBody)
    return vehicle
