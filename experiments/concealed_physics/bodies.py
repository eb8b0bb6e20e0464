"""The bodies in which physics is concealed, and how they are driven: zigzags, circles, pulses, depth, speed.

NPS AUV II in six degrees of freedom, its constant thrust replaced by a propeller whose speed is recorded, so that the
speed changes, and if asked for with nonlinear damping and the rigid body's Coriolis forces; DSRV in the vertical plane;
a rig of one coordinate.
"""

import math

import numpy as np
import tomlkit

from jaxsub.simulation.manoeuvres import doublet, prbs, square, three_two_one_one
from jaxsub.vehicle import AbstractVehicle, vehicle_from
from jaxsub.vehicle.catalogue import dsrv, nps_auv_ii
from jaxsub.vehicle.write import vehicle_text

INTERVAL = 0.2
CRUISE_SHAFT = 60.0
NO_VELOCITY = ("p", "q", "r", "phi", "theta", "psi", "z")
_ENVIRONMENT = {"nps-temperature": {"temperature": "T"}, "nps-altitude": {"altitude": "altitude"}}
_DEPTH = {"nps-altitude": 32.0, "nps-shallow": 5.0, "dsrv": 60.0}
# rad, which no run's command of the rudder exceeds
LARGEST_RUDDER = 0.32
# of the dive commands of deep water, where water is shallow
DIVE = {"nps-altitude": 0.5, "nps-shallow": 0.35}


# SI; in a turn each is a fifth to a half of the linear term of its equation. X_vr and X_wq are what added mass makes.
_NONLINEAR = {"X_u|u|": -28.0, "Y_v|v|": -4200.0, "Z_w|w|": -7000.0, "M_q|q|": -1.0e5, "N_r|r|": -4.2e4,
              "X_vr": 4094.0, "X_wq": -17865.0}  # fmt: skip


def body(name: str, channels: tuple[str, ...] = (), nonlinear: bool = False) -> AbstractVehicle:
    """The true vehicle, with all of its channels or those given."""
    if name == "rig":
        return vehicle_from(_RIG, "rig")
    made = dsrv() if name == "dsrv" else nps_auv_ii()
    data = tomlkit.parse(vehicle_text(made)).unwrap()
    if name == "dsrv":
        # the publication prints no righting moment; without one the depth of a run of minutes has no bound
        data["body"]["centre_of_buoyancy"] = [0.0, 0.0, -0.03]
    else:
        push = data["coefficients"].pop("X_0")["value"]
        data["coefficients"]["X_nn"] = {"value": push / CRUISE_SHAFT**2}
        data["inputs"]["shaft_speed"] = "n"
        data["environment"] = _ENVIRONMENT.get(name, {})
    if nonlinear:
        data["coefficients"] |= _NONLINEAR
        data["model"] = {"coriolis": "rigid-body"}
    if channels:
        data["outputs"] = {c: data["outputs"][c] for c in channels}
    return vehicle_from(data, name)


_RIG = {
    "schema": 1,
    "name": "rig",
    "kind": "mechanism",
    "dof": ["x"],
    "coefficients": {"I_x": {"value": 1.0, "fixed": True}, "D_x": 0.4, "K_x": 4.0, "B_x_drive": 2.0},
    "inputs": {"drive": "f"},
    "outputs": {"x": {"sigma": 0.005}, "x_rate": {"sigma": 0.01}},
}


def start_state(name: str, vehicle: AbstractVehicle, rng: np.random.Generator) -> np.ndarray:
    """Near the cruise, headed anywhere, at the depth where the body works, (s,)."""
    layout = vehicle.layout
    if name == "rig":
        return 0.1 * rng.uniform(-1.0, 1.0, 2)
    ahead = {"surge": vehicle.speed}
    placed = {"z": _DEPTH.get(name, 15.0) + rng.uniform(-1.0, 1.0), "psi": rng.uniform(-3.0, 3.0)}
    rates = [ahead.get(e, 0.0) for e in layout.equations]
    return np.array(rates + [placed.get(p, 0.0) for p in layout.positions])


def commands(name: str, run: int, samples: int, rng: np.random.Generator) -> np.ndarray:
    """What run number `run` commands of each input of the vehicle, (samples, inputs), SI; no two runs alike."""
    t = INTERVAL * np.arange(samples)
    draw = lambda low, high: rng.uniform(low, high)
    seed = lambda: int(rng.integers(2**31))
    if name == "rig":
        sweep = np.sin(2.0 * math.pi * (0.1 + draw(0.3, 0.5) * t / t[-1]) * t)
        return (0.8 * sweep + prbs(samples, 6 + 3 * run, 0.8, seed()))[:, None]
    if name == "dsrv":
        return (0.05 * square(t, draw(18.0, 30.0), 1.0) + prbs(samples, 15 + 5 * run, 0.03, seed()))[:, None]
    rudder = _rudder(t, run, draw, seed)
    dive = 0.06 * square(t, draw(24.0, 44.0), 1.0) + _pulses(t, draw, 0.10) + prbs(samples, 20, 0.05, seed())
    dive *= DIVE.get(name, 1.0)
    # right and left apart now and then: only the difference shakes roll
    apart = prbs(samples, 12 + 4 * run, 0.2, seed()) + doublet(t, draw(0.05, 0.4) * t[-1], 3.0, 0.1)
    shaft = CRUISE_SHAFT * (1.0 + 0.25 * prbs(samples, 110 + 20 * run, 1.0, seed()) * draw(0.7, 1.0))
    return np.stack([rudder, dive + apart, dive - apart, shaft], axis=1)


def _rudder(t: np.ndarray, run: int, draw, seed) -> np.ndarray:
    """A zigzag, a circle each way, or a random sequence, in a different order in each run."""
    third = len(t) // 3
    zigzag = square(t, draw(14.0, 26.0), draw(0.2, LARGEST_RUDDER))
    circles = square(t, draw(60.0, 80.0), draw(0.12, 0.2))
    random = prbs(len(t), 25 + 5 * run, draw(0.2, 0.28), seed())
    order = np.roll([zigzag, circles, random], run, axis=0)
    part = np.minimum(np.arange(len(t)) // max(third, 1), 2)
    return order[part, np.arange(len(t))]


def _pulses(t: np.ndarray, draw, amplitude: float) -> np.ndarray:
    return three_two_one_one(t, draw(0.0, 0.5) * t[-1], 2.5, amplitude)
