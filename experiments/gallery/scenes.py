"""Who shows each effect, in which channel and how strongly: the scenes of the gallery.

The bodies are those of `experiments.concealed_physics`; every scene of one body is one and the same manoeuvre. A size
that a scene does not state is found by the simulation: as large as moves the channel by `SHARE` of its own range.
"""

import dataclasses
from collections.abc import Mapping

import numpy as np

from experiments.concealed_physics.bodies import CRUISE_SHAFT, body
from jaxsub.effects import Facts
from jaxsub.recording import Recording
from jaxsub.simulation.manoeuvres import doublet, prbs, square
from jaxsub.vehicle import AbstractVehicle

SHARE = 0.2
SAMPLES, INTERVAL = 400, 0.2


@dataclasses.dataclass(frozen=True)
class Scene:
    """`name` of the effect; `label`: which of its forms; `channel` that shows it; fixed numbers by field; body."""

    name: str
    channel: str
    label: str = ""
    numbers: Mapping[str, float] = dataclasses.field(default_factory=dict)
    body: str = "nps"


SCENES = (
    Scene("quadratic-damping", "v", "sway"),
    Scene("cubic-damping", "r", "yaw"),
    Scene("crossflow-drag", "v", "horizontal", {"C_d": 1.0}),
    Scene("coriolis-coupling", "w", "", {"fraction": 1.0}),
    Scene("turning-speed-loss", "u", "yaw,yaw"),
    Scene("speed-scaling", "r", "yaw,rudder"),
    Scene("hull-asymmetry", "psi", "yaw"),
    Scene("fluid-memory", "v", "sway", {"T_m": 4.0}),
    Scene("trim-offset", "theta", "x"),
    Scene("buoyancy-error", "z"),
    Scene("hull-compressibility", "z"),
    Scene("density-stratification", "z"),
    Scene("thermal-expansion", "z", body="nps-temperature"),
    Scene("mass-shift", "theta", "x", {"t_0": 30.0}),
    Scene("actuator-lag", "r", "rudder", {"T": 1.5}),
    Scene("actuator-delay", "r", "rudder", {"tau": 1.2}),
    Scene("actuator-rate-limit", "r", "rudder", {"rate": 0.12}),
    Scene("actuator-saturation", "r", "rudder", {"limit": 0.18}),
    Scene("actuator-deadband", "r", "rudder", {"d": 0.08}),
    Scene("actuator-backlash", "r", "rudder", {"b": 0.06}),
    Scene("actuator-misalignment", "psi", "rudder"),
    Scene("actuator-gain", "r", "rudder", {"gain": -0.3}),
    Scene("control-surface-stall", "r", "rudder", {"k": 3.0}),
    Scene("propeller-race", "r", "yaw,rudder"),
    Scene("propeller-torque", "phi"),
    Scene("propeller-asymmetry", "r", "yaw"),
    Scene("thrust-loss", "u", "", {"t_0": 30.0}),
    Scene("thruster-cross-coupling", "p", "roll,rudder"),
    Scene("current", "u", "", {"V_N": 0.25, "V_E": 0.15}),
    Scene("wave-forcing", "w", "heave", {"omega": 0.9, "a": 120.0, "b": 0.0}),
    Scene("free-surface-suction", "w", "", {"h": 2.0}, body="nps-shallow"),
    Scene("bottom-suction", "w", "", {"h": 2.0}, body="nps-altitude"),
    Scene("tether-drag", "u"),
    Scene("coulomb-friction", "x", "x", {"F_c": 0.12, "F_0": 0.0}, body="rig"),
    Scene("asymmetric-damping", "x", "x", body="rig"),
    Scene("cubic-stiffness", "x", "x", body="rig"),
    Scene("hysteresis", "x", "x", {"F_h": 0.4, "x_y": 0.5}, body="rig"),
    Scene("saturation", "x", "x", {"x_s": 0.3}, body="rig"),
    Scene("sensor-bias", "r", "r"),
    Scene("sensor-scale", "r", "r", {"scale": 0.2}),
    Scene("sensor-delay", "r", "r", {"tau": 1.0}),
    Scene("sensor-misalignment", "q", "q,r", {"epsilon": 0.2}),
    Scene("sensor-lever-arm", "v", "v,x", {"arm": 1.0}),
    Scene("sensor-saturation", "r", "r", {"limit": 0.06}),
    Scene("sensor-rectification", "r", "r", {"f": 1.0}),
    Scene("sensor-drift", "r", "r"),
)
_DEPTH = {"nps-altitude": 20.0, "nps-shallow": 3.0}


def stage(name: str) -> tuple[AbstractVehicle, Recording, np.ndarray]:
    """A body, what drives it, and where it starts: (s,)."""
    vehicle = body(name)
    layout = vehicle.layout
    t = INTERVAL * np.arange(SAMPLES)
    if name == "rig":
        drive = 0.4 * np.sin(2.0 * np.pi * (0.05 + 0.004 * t) * t) + prbs(SAMPLES, 15, 0.2, 7)
        return vehicle, Recording(name, t, {"f": drive}, name), np.zeros(2)
    dive = doublet(t, 10.0, 8.0, 0.1) + doublet(t, 45.0, 8.0, -0.1)
    apart = doublet(t, 25.0, 3.0, 0.1)
    if name == "nps-shallow":
        dive = 0.2 * dive
    columns = {
        "delta_r": square(t, 26.0, 0.26) * (t > 5.0),
        "delta_er": dive + apart,
        "delta_el": dive - apart,
        "n": CRUISE_SHAFT * np.where(t < 50.0, 1.0, 0.8),
        "T": 288.15 - 6.0 * np.sin(np.pi * t / t[-1]),
        "altitude": 4.0 - 2.5 * np.sin(np.pi * t / t[-1]),
    }
    columns = {c: columns[c] for c in (*layout.held, *layout.interpolated)}
    start = dict.fromkeys((*layout.equations, *layout.positions), 0.0)
    start |= {"surge": vehicle.speed, "z": _DEPTH.get(name, 10.0)}
    return vehicle, Recording(name, t, columns, name), np.array(list(start.values()))


def facts(vehicle: AbstractVehicle, recording: Recording, shown: Mapping[str, np.ndarray]) -> Facts:
    """What the vocabulary asks before it lists its candidates; the true motion stands for the recorded one."""
    layout = vehicle.layout
    commands = {actuator: recording.column(column) for actuator, column in layout.inputs}
    of = lambda c: (float(np.sqrt(np.mean(c**2))), float(np.abs(c).max()), float(np.abs(np.diff(c)).max() / INTERVAL))
    rig = layout.kind == "mechanism"
    depth = shown.get("z", np.zeros(1))
    return Facts(
        layout.kind,
        layout.equations,
        tuple(commands),
        layout.channels,
        tuple(name for name, _ in layout.environment),
        layout.length,
        layout.diameter,
        dict.fromkeys(layout.equations, 0.1),
        INTERVAL,
        duration=SAMPLES * INTERVAL,
        position_scale={q: float(np.abs(shown[q]).max()) for q in layout.equations} if rig else {},
        input_range={actuator: of(command) for actuator, command in commands.items()},
        output_range={c: (float(values.min()), float(values.max())) for c, values in shown.items()},
        depth_range=(float(depth.min()), float(depth.max())),
        tones={} if rig else dict.fromkeys(layout.equations, (0.9,)),
        frequencies=1,
        fixed_gains=tuple(commands),
        speed=vehicle.speed,
    )
