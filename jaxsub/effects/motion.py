"""What a force, an actuator or a sensor may look at: the motion at one time, or along a whole run."""

import abc
import re
from collections.abc import Mapping

import equinox as eqx
import numpy as np
from jaxtyping import Array, Float

# forces are plain array arithmetic, so they run on JAX arrays inside a simulation and on NumPy ones along a stored run
Signal = Array | np.ndarray

EQUATIONS = ("surge", "sway", "heave", "roll", "pitch", "yaw")
VELOCITIES: dict[str, str] = dict(zip(EQUATIONS, "uvwpqr", strict=True))
FORCES: dict[str, str] = dict(zip(EQUATIONS, "XYZKMN", strict=True))
FORCE_UNITS: dict[str, str] = dict(zip(EQUATIONS, ["N"] * 3 + ["N m"] * 3, strict=True))
GRAVITY = 9.80665
# kg/m³, of sea water
STANDARD_DENSITY = 1025.0
PROPULSION = ("shaft_speed", "thrust")
FINS = ("rudder", "elevator_right", "elevator_left", "elevator", "stern_plane")
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
    known: dict[str, str] = dict.fromkeys((*lines, "speed"), "(m/s)") | {"thrust": "N"}
    known |= dict.fromkeys((*angles, "shaft_speed"), "(rad/s)")
    units = [known.get(variable, "rad") for variable in variables]
    return "/".join([force, *units]) if equation in EQUATIONS else "1"


def quantity_of(channels: str, quantities: Mapping[str, str]) -> str:
    """What outputs, listed with commas between, show by `quantities`; nothing where their own names say it."""
    named = [quantities.get(channel, "") for channel in channels.split(",")]
    return ",".join(named) if any(named) else ""


def read_quantity(quantity: str, channel: str) -> tuple[str, float, str]:
    """The channel of the motion, sign and SI unit that `quantity` says, or else the name of the `channel`."""
    match = re.fullmatch(r"(-?)(\w+)\[(.*)\]", quantity)
    if match is None:
        return channel, 1.0, CHANNEL_UNITS.get(channel, "1")
    return match[2], -1.0 if match[1] else 1.0, match[3] or "1"


class AbstractActuation(eqx.Module):
    """What the actuators of a model do."""

    @abc.abstractmethod
    def force_of(self, name: str, motion: "Motion") -> dict[str, Signal]:
        """Generalised force (N or N m) by equation of the actuator `name` alone, of the motion's shape.

        **Raises** `KeyError` for one that the model lacks.
        """


class Motion(eqx.Module):
    """The state of a vehicle and what acts on it, by name; every leaf may carry leading (time) axes.

    **Fields**

    - `rates`: velocity of each equation of motion (m/s or rad/s): all six of a submerged body, also the locked ones.
    - `positions`: `phi theta psi x y z`, or a mechanism's coordinates (m or rad).
    - `actuators`: deflections (rad), speeds (rad/s) and thrusts (N) by actuator name.
    - `environment`: recorded surroundings, SI, such as `density` (kg/m³).
    - `inertia`: (n, n) mass matrix of the equations in `rates`, SI.
    - `buoyancy`: displaced weight (N); zero for a mechanism.
    - `cruise`: the operating speed U_c (m/s) about which linear coefficients were taken.
    - `time`: s from the run's own start.
    - `accelerations`: rates of the free equations' velocities (m/s² or rad/s²), where an accelerometer needs them.
    - `water`: velocity of the water over ground in body axes (m/s), by the equation of the body's own; absent at rest.
    - `actuation`: the forces of the model's own actuators, each by itself.
    - `first_order`: whether `rates` are the states themselves, as of a user's own model.
    """

    rates: dict[str, Signal]
    positions: dict[str, Signal]
    actuators: dict[str, Signal]
    environment: dict[str, Signal]
    inertia: Float[Signal, "n n"]
    buoyancy: Signal | float
    cruise: Signal | float
    time: Signal | float = 0.0
    accelerations: dict[str, Signal] = eqx.field(default_factory=dict)
    water: dict[str, Signal] = eqx.field(default_factory=dict)
    actuation: AbstractActuation | None = None
    first_order: bool = eqx.field(static=True, default=False)

    @property
    def flow(self) -> dict[str, Signal]:
        """Velocities through the water: forces of the water follow these."""
        return self.rates | {equation: self.rates[equation] - moving for equation, moving in self.water.items()}


def velocities(motion: Motion) -> dict[str, Signal]:
    """Rates of `motion` by their names in files: `u` for surge, `q_rate` for a mechanism's coordinate `q`.

    Those of a model of first order are its states.
    """
    other = "" if motion.first_order else "_rate"
    return {VELOCITIES.get(equation, f"{equation}{other}"): rate for equation, rate in motion.rates.items()}


def by_name(motion: Motion) -> dict[str, Signal]:
    """All signals of `motion` that a force may follow: velocities, positions, actuators, surroundings."""
    return velocities(motion) | motion.positions | motion.actuators | motion.environment


class Facts(eqx.Module):
    """What the vocabulary needs to know of a vehicle and its recordings to list its candidates.

    **Fields**

    - `kind`: `submerged-body` or `mechanism`.
    - `equations`: the free equations of motion.
    - `actuators`, `channels`, `environment`: names of what is recorded.
    - `length`, `diameter`: of the hull, m (zero for a mechanism). `density`: of the water that it was made for, kg/m³.
    - `speed`: that it operates at, m/s; zero of what has none.
    - `rate_scale`: rms velocity of each free equation along the recordings.
    - `sample_interval`: the recordings' median, s. `duration`: of the longest, s.
    - `position_scale`: largest size of each coordinate of a mechanism.
    - `input_range`: rms, largest size and largest rate (per s) of each actuator's command.
    - `output_range`: least and largest of what was recorded of each channel.
    - `depth_range`: least and largest depth, m; alike where it neither moves by itself nor is recorded.
    - `quantities`: of each output whose name does not say it, what it shows: `-v[m/s]` of a velocity to port.
    - `has`: what the vehicle contains of what an effect could say: names of `Derivative`s, `coriolis`, free scales and
      offsets of sensors such as `psi.offset`.
      An actuator by a name of its own has those of its force; a control surface has one such as `N_uu_port_fin`.
    - `fixed_gains`: the vehicle's actuators whose force no free number of its own scales as a whole.
    - `prescribed`: motions that the vehicle takes from the recordings and that are no channels.
    - `varying`: numbers that may differ by run, each with its SI unit and what feels it.
    - `tones`: frequencies (rad/s) at which what each equation misses stands out, inside `wave_band`; `frequencies`: how
      many they were chosen among.

    What is not known (zero or absent) has no candidates whose grid is taken from it.
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
    duration: float = 0.0
    position_scale: dict[str, float] = eqx.field(default_factory=dict)
    input_range: dict[str, tuple[float, float, float]] = eqx.field(default_factory=dict)
    output_range: dict[str, tuple[float, float]] = eqx.field(default_factory=dict)
    depth_range: tuple[float, float] = (0.0, 0.0)
    tones: dict[str, tuple[float, ...]] = eqx.field(default_factory=dict)
    frequencies: int = 0
    quantities: dict[str, str] = eqx.field(default_factory=dict)
    has: frozenset[str] = frozenset()
    fixed_gains: tuple[str, ...] = ()
    density: float = STANDARD_DENSITY
    speed: float = 0.0
    varying: tuple[tuple[str, str, tuple[str, ...]], ...] = ()
    prescribed: tuple[str, ...] = ()

    @property
    def recorded(self) -> tuple[str, ...]:
        """All that instruments recorded of the motion: channels, and prescribed motions."""
        return (*self.channels, *self.prescribed)

    @property
    def shown(self) -> dict[str, str]:
        """What each channel shows, such as `v` of `dvl_v`."""
        return {channel: read_quantity(self.quantities.get(channel, ""), channel)[0] for channel in self.channels}

    @property
    def measures_depth(self) -> bool:
        """Whether any channel shows the depth, in whatever form."""
        return bool({"z", "depth", "pressure"} & set(self.shown.values()))

    @property
    def largest_commands(self) -> dict[str, float]:
        """The largest size of the command of each actuator that moved."""
        sizes = {name: self.input_range[name][1] for name in self.actuators if name in self.input_range}
        return {name: size for name, size in sizes.items() if size > 0.0}

    @property
    def travel(self) -> dict[str, float]:
        """How far each coordinate of a mechanism went, of those that moved."""
        far = self.position_scale if self.kind == "mechanism" else {}
        return {e: far[e] for e in self.equations if far.get(e, 0.0) > 0.0}

    @property
    def fins(self) -> tuple[str, ...]:
        """The actuators of a body that deflect."""
        lifting = lambda name: any(f"{force}_uu_{name}" in self.has for force in FORCES.values())
        body = self.kind == "submerged-body"
        return tuple(name for name in self.actuators if body and (name in FINS or lifting(name)))

    @property
    def propulsion(self) -> tuple[str, ...]:
        """The actuators of a body that push, by the names that are for it."""
        return tuple(name for name in PROPULSION if self.kind == "submerged-body" and name in self.actuators)

    @property
    def driven(self) -> bool:
        """Whether an actuator pushes in surge, such as a thruster by a name of its own, or it operates at a speed."""
        pushes = any(f"B_surge_{name}" in self.has for name in self.actuators)
        return bool(self.propulsion) or pushes or self.speed != 0.0
