"""The list of effects that a diagnosis may name, those that are installed beside it, and those of a user's script."""

import inspect
from importlib import metadata
from pathlib import Path

from ..errors import InputError
from .actuator_curves import ActuatorDeadband, ActuatorMisalignment, ActuatorSaturation, ControlSurfaceStall
from .actuator_gain import ActuatorGain
from .actuators import ActuatorBacklash, ActuatorDelay, ActuatorLag, ActuatorRateLimit
from .base import (
    AbstractActuator,
    AbstractDerivative,
    AbstractEffect,
    AbstractFlow,
    AbstractForce,
    AbstractInstrument,
)
from .boundaries import BottomSuction, FreeSurfaceSuction, TetherDrag
from .derivatives import Derivative
from .environment import Current, WaveForcing
from .events import MassShift, ThrustLoss
from .hull import CoriolisCoupling, CrossflowDrag, HullAsymmetry, SpeedScaling, TurningSpeedLoss
from .hull_damping import CubicDamping, QuadraticDamping
from .hydrostatics import BuoyancyError, DensityStratification, HullCompressibility, ThermalExpansion, TrimOffset
from .mechanisms import AsymmetricDamping, CoulombFriction, CubicStiffness, Saturation
from .memory import FluidMemory, Hysteresis
from .motion import Facts
from .polynomial import PolynomialTerm
from .propulsion import PropellerAsymmetry, PropellerRace, PropellerTorque, ThrusterCrossCoupling
from .run_variation import RunVariation
from .script import executed
from .sensor_mounting import SensorLeverArm, SensorMisalignment
from .sensor_response import SensorDelay, SensorRectification, SensorSaturation
from .sensors import SensorBias, SensorDrift, SensorScale

GROUP = "jaxsub.effects"

VOCABULARY: tuple[type[AbstractEffect], ...] = (
    QuadraticDamping,
    CubicDamping,
    CrossflowDrag,
    CoriolisCoupling,
    TurningSpeedLoss,
    SpeedScaling,
    HullAsymmetry,
    FluidMemory,
    TrimOffset,
    BuoyancyError,
    HullCompressibility,
    DensityStratification,
    ThermalExpansion,
    MassShift,
    ActuatorLag,
    ActuatorDelay,
    ActuatorRateLimit,
    ActuatorSaturation,
    ActuatorDeadband,
    ActuatorBacklash,
    ActuatorMisalignment,
    ActuatorGain,
    ControlSurfaceStall,
    PropellerRace,
    PropellerTorque,
    PropellerAsymmetry,
    ThrustLoss,
    ThrusterCrossCoupling,
    Current,
    WaveForcing,
    FreeSurfaceSuction,
    BottomSuction,
    TetherDrag,
    CoulombFriction,
    AsymmetricDamping,
    CubicStiffness,
    Hysteresis,
    Saturation,
    SensorBias,
    SensorScale,
    SensorDelay,
    SensorMisalignment,
    SensorLeverArm,
    SensorSaturation,
    SensorRectification,
    SensorDrift,
)


def vocabulary() -> tuple[type[AbstractEffect], ...]:
    """`VOCABULARY`, `RunVariation`, `PolynomialTerm`, and the entry points `jaxsub.effects` of installed packages.

    **Raises** `InputError` for an entry point that cannot be loaded, is no effect or bears a name that is taken.
    """
    kinds: list[type[AbstractEffect]] = [*VOCABULARY, RunVariation, PolynomialTerm]
    for entry in metadata.entry_points(group=GROUP):
        where = f"entry point {entry.name} of {GROUP}"
        try:
            kind = entry.load()
        except Exception as error:  # whatever the package does when it is imported
            raise InputError(where, f"cannot be loaded: {error}", "mend or remove that package") from error
        if not is_effect(kind):
            raise InputError(where, f"{entry.value} is no effect", "name a concrete subclass of AbstractEffect")
        if kind.name in [other.name for other in kinds]:
            raise InputError(where, f"the name {kind.name} is taken", "give the effect another")
        kinds.append(kind)
    return tuple(kinds)


def from_script(path: str | Path) -> tuple[type[AbstractEffect], ...]:
    """The effects that the Python script at `path` defines, in the order of their definition.

    **Raises** `InputError` for a file that cannot be run, that defines no effect, or one whose name is taken.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(str(path), "is no file", "give the path of a Python script")
    try:
        module = executed(path)
    except Exception as error:  # whatever the script does
        raise InputError(str(path), f"{type(error).__name__}: {error}", "mend the script") from error
    if module is None:
        raise InputError(str(path), "is no Python script", "give a file that ends in .py")
    own = [kind for kind in vars(module).values() if is_effect(kind) and kind.__module__ == module.__name__]
    if not own:
        raise InputError(str(path), "defines no effect", "write a subclass of AbstractForce and the like")
    names = [kind.name for kind in (*vocabulary(), *own)]
    for kind in own:
        if names.count(kind.name) > 1:
            raise InputError(str(path), f"the name {kind.name} is taken", "give the effect another")
    return tuple(own)


def is_effect(kind: object) -> bool:
    """Whether `kind` is a force, an actuator's or a sensor's effect that can be made, with a name and a family."""
    sorts = AbstractForce | AbstractFlow | AbstractActuator | AbstractInstrument
    if not (inspect.isclass(kind) and issubclass(kind, sorts)):
        return False
    named = isinstance(getattr(kind, "name", None), str) and isinstance(getattr(kind, "family", None), str)
    return named and not inspect.isabstract(kind)


def candidates(facts: Facts, kinds: tuple[type[AbstractEffect], ...] | None = None) -> list[AbstractEffect]:
    """Every form of every effect of `kinds`, by default of `vocabulary`, that makes sense on the vehicle of `facts`.

    What the vehicle contains already (`Facts.has`) is no candidate.
    """
    every = [effect for kind in (vocabulary() if kinds is None else kinds) for effect in kind.candidates(facts)]
    return [effect for effect in every if effect.term not in facts.has]


def named(term: Derivative, facts: Facts, kinds: tuple[type[AbstractEffect], ...]) -> AbstractDerivative | None:
    """The first effect of `kinds` whose number is the coefficient of `term`, if a vehicle of `facts` can have it."""
    single = [kind for kind in kinds if issubclass(kind, AbstractDerivative)]
    forms = (effect for kind in single for effect in kind.candidates(facts))
    return next((e for e in forms if isinstance(e, AbstractDerivative) and e.derivative == term), None)


def looked_at(facts: Facts, kinds: tuple[type[AbstractEffect], ...] | None = None) -> dict[str, int]:
    """By name, how many forms the candidates of each effect were chosen among on the vehicle of `facts`, where not all.

    `kinds` are the effects, by default those of `vocabulary`.
    """
    counts = {kind.name: kind.looked_at(facts) for kind in (vocabulary() if kinds is None else kinds)}
    return {name: count for name, count in counts.items() if count}
