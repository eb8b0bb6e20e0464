"""What a force, an actuator or a sensor may look at: the motion at one time, or along a whole run."""

import equinox as eqx
import numpy as np
from jaxtyping import Array, Float

# forces are plain array arithmetic, so they run on JAX arrays inside a simulation and on NumPy ones along a stored run
Signal = Array | np.ndarray

EQUATIONS = ("surge", "sway", "heave", "roll", "pitch", "yaw")
VELOCITIES: dict[str, str] = dict(zip(EQUATIONS, "uvwpqr", strict=True))
FORCES: dict[str, str] = dict(zip(EQUATIONS, "XYZKMN", strict=True))
GRAVITY = 9.80665
_CHANNELS = {
    "m/s": ("u", "v", "w", "speed", "depth_rate"),
    "rad/s": ("p", "q", "r", "heading_rate"),
    "rad": ("phi", "theta", "psi"),
    "m": ("x", "y", "z", "depth"),
    "m/s/s": ("ax", "ay", "az"),
}
CHANNEL_UNITS: dict[str, str] = {channel: unit for unit, channels in _CHANNELS.items() for channel in channels}


def unit_per(equation: str, *variables: str) -> str:
    """The unit of a coefficient that makes a force of `equation` from a product of variables."""
    lines, angles = EQUATIONS[:3], EQUATIONS[3:]
    force = "N" if equation in lines else "N*m"
    units = ["(m/s)" if v in lines else "(rad/s)" if v in angles else "rad" for v in variables]
    return "/".join([force, *units]) if equation in EQUATIONS else "1"


class Motion(eqx.Module):
    """The state of a vehicle and what acts on it, by name; every leaf may carry leading (time) axes.

    **Fields**

    - `rates`: velocity of each equation of motion (m/s or rad/s): all six of a submerged body, also the locked ones.
    - `positions`: `phi theta psi x y z`, or a mechanism's coordinates (m or rad).
    - `actuators`: deflections and speeds by actuator name (rad, rad/s, N).
    - `environment`: recorded surroundings, such as `density` (kg/m³).
    - `inertia`: (n, n) mass matrix of the equations in `rates`.
    - `buoyancy`: displaced weight (N); zero for a mechanism.
    - `cruise`: the operating speed U_c (m/s) about which linear coefficients were taken.
    """

    rates: dict[str, Signal]
    positions: dict[str, Signal]
    actuators: dict[str, Signal]
    environment: dict[str, Signal]
    inertia: Float[Array, "n n"]
    buoyancy: Signal | float
    cruise: Signal | float


class Facts(eqx.Module):
    """What the vocabulary needs to know of a vehicle and its recordings to list its candidates.

    **Fields**

    - `kind`: `submerged-body` or `mechanism`.
    - `equations`: the free equations of motion.
    - `actuators`, `channels`, `environment`: names of what is recorded.
    - `length`, `diameter`: of the hull, m (zero for a mechanism).
    - `rate_scale`: rms velocity of each free equation along the recordings.
    - `sample_interval`: the recordings' median, s.
    """

    kind: str
    equations: tuple[str, ...]
    actuators: tuple[str, ...]
    channels: tuple[str, ...]
    environment: tuple[str, ...]
    length: float
    diameter: float
    rate_scale: dict[str, float]
    sample_interval: float
