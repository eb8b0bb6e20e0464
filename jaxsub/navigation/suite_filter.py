"""The filter of a suite of sensors: what each measures, the size of its errors, and the rule of the process noise."""

import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np

from ..filter import (
    AbstractNoiseRule,
    ConsistentFuzzyNoise,
    ConstantNoise,
    ExtendedKalmanFilter,
    FuzzyNoise,
    InnovationGate,
    InnovationNoise,
    SageHusaNoise,
)
from .aided import (
    AbstractAid,
    AidedNavigation,
    BodyVelocityAid,
    CompassAid,
    MagneticAid,
    PositionAid,
    RangeAid,
    VelocityAid,
    blocks,
)
from .alignment import MagneticField
from .rows import sigmas
from .start import Start, field_of
from .strapdown import SensorNoise, StrapdownNavigation
from .suite import Sensor, SensorSuite
from .suite.grades import motion_density
from .suite.log import SensorLog

# of an adaptive rule's least noise, its most
_MOST = 30.0
# names of what is known beforehand of position and velocity
SUPPOSED = ("reach", "speed")


def filter_of(
    log: SensorLog, suite: SensorSuite, start: Start
) -> tuple[ExtendedKalmanFilter, tuple[str, ...], dict[str, slice]]:
    """The filter of a suite, the sensors whose delay is a state, and the channels of each sensor."""
    gyro, accelerometer = suite.only("gyro"), suite.only("accelerometer")
    assert gyro.noise is not None and accelerometer.noise is not None
    field = field_of(log, suite)
    aids, roots, names, delays = [], [], [], []
    # the state is that of the accelerometer's place
    place = np.array(accelerometer.lever_arm)
    for sensor in suite.aiding:
        delay = -1
        if sensor.delay_std > 0.0:
            delay = len(delays)
            delays.append(sensor)
        aids.append(_aid(sensor, delay, field, place))
        # a field's heading is in terms of its own deviation, which lasts from place to place
        roots.append(np.ones(1) if sensor.kind == "magnetometer" else sigmas(sensor, log.origin))
        names.append(sensor.name)
    known = {"lever_arm": jnp.asarray(-place), "rows": (0, 1, 2), "delay": -1}
    supposed: tuple[AbstractAid, ...] = (PositionAid(**known), VelocityAid(**known))
    for name, aid in zip(SUPPOSED, supposed, strict=True):
        if math.isfinite(size := getattr(suite.motion, name)):
            aids.append(aid)
            roots.append(np.full(3, size))
            names.append(name)
    adds = suite.rule != "consistent"
    noise = SensorNoise(
        gyro.noise.density if adds else 0.0,
        accelerometer.noise.density if adds else 0.0,
        motion_density(gyro.noise.nonlinearity),
        # of the accelerometers' scales there are no states
        motion_density(math.hypot(accelerometer.noise.scale_error, accelerometer.noise.nonlinearity)),
        math.inf,
    )
    inertial = StrapdownNavigation(noise) if field is None else StrapdownNavigation(noise, field)
    process = AidedNavigation(inertial, tuple(aids), len(delays))
    std = np.concatenate([start.std, [sensor.delay_std for sensor in delays]])
    R_root = jnp.diag(jnp.asarray(np.concatenate(roots) if roots else np.zeros(0)))
    filter = ExtendedKalmanFilter(process, _rule(suite, len(std), len(R_root)), R_root, jnp.diag(jnp.asarray(std)),
                                  gate=_gate(aids, names))  # fmt: skip
    # numbers as arrays: what differs between logs is no part of a program
    filter = jax.tree.map(lambda leaf: jnp.asarray(leaf) if isinstance(leaf, float) else leaf, filter)
    return filter, tuple(sensor.name for sensor in delays), dict(zip(names, blocks(aids), strict=True))


def _aid(sensor: Sensor, delay: int, field: MagneticField | None, place: np.ndarray) -> AbstractAid:
    """The sensor as an aid of what moves like the `place` of the accelerometer (3,), m."""
    arm = jnp.asarray(np.array(sensor.lever_arm) - place)
    rows = tuple(range(len(sensor.channels)))
    match sensor.kind:
        case "magnetometer":
            assert field is not None
            return MagneticAid(field=field, delay=delay)
        case "compass":
            return CompassAid(delay=delay)
        case "pressure" | "depth":
            return PositionAid(lever_arm=arm, rows=(2,), delay=delay)
        case "dvl":
            return BodyVelocityAid(lever_arm=arm, delay=delay)
        case "velocity":
            return VelocityAid(lever_arm=arm, rows=rows, delay=delay)
        case "range":
            return RangeAid(lever_arm=arm, beacon=jnp.asarray(sensor.beacon), delay=delay)
        case _:
            return PositionAid(lever_arm=arm, rows=rows, delay=delay)


def _gate(aids: list[AbstractAid], names: list[str]) -> InnovationGate:
    """Everything is tested but a field's heading, which says itself how far it is disturbed, and what is supposed."""
    gate = InnovationGate.of(sum(block.stop - block.start for block in blocks(aids)), dtype=float)
    widths = np.array(gate.widths)
    for aid, name, block in zip(aids, names, blocks(aids), strict=True):
        if isinstance(aid, MagneticAid) or name in SUPPOSED:
            widths[block] = np.inf
    return dataclasses.replace(gate, widths=jnp.asarray(widths))


def _rule(suite: SensorSuite, states: int, channels: int) -> AbstractNoiseRule:
    """The suite's process-noise rule, of which the least is the wander of the biases."""
    gyro, accelerometer = suite.only("gyro").noise, suite.only("accelerometer").noise
    assert gyro is not None and accelerometer is not None
    least = np.zeros(states)
    least[9:12], least[12:15] = gyro.wander, accelerometer.wander
    whole = least.copy()
    whole[:3], whole[3:6] = gyro.density, accelerometer.density
    low, high = jnp.asarray(least), jnp.asarray(_MOST * whole)
    match suite.rule:
        case "consistent":
            return ConsistentFuzzyNoise(jnp.asarray(whole))
        case "fuzzy":
            return FuzzyNoise(low, high)
        case "sage-husa":
            return SageHusaNoise(low, low, high)
        case "innovation":
            return InnovationNoise(low, channels)
        case _:
            return ConstantNoise(jnp.diag(low))
