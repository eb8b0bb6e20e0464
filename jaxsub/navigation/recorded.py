"""A navigation as a recording, whose columns are channels that vehicle files measure, and as a summary."""

import math
from typing import Any

import numpy as np

from ..errors import InputError
from ..recording import Recording
from .aided import SCALES, by_matrix
from .consistency import consistency
from .navigate import Navigation
from .track import MOTION, Track
from .unobserved import unobserved

_RATES, _FORCES = ("p", "q", "r"), ("ax", "ay", "az")
_AXES = ("x", "y", "z")
UNITS: dict[str, str] = dict(zip(MOTION, ("rad",) * 3 + ("m/s",) * 3 + ("m",) * 3, strict=True))
UNITS |= dict.fromkeys(_RATES, "rad/s") | dict.fromkeys(_FORCES, "m/s^2")
CONSTANTS = tuple(f"{part}_{axis}" for part in ("gyro_bias", "accelerometer_bias", "gyro_scale") for axis in _AXES)
CONSTANTS += tuple(f"gyro_misalignment_{a}{b}" for a in _AXES for b in _AXES if a != b)
_OF_CONSTANTS = ("rad/s",) * 3 + ("m/s^2",) * 3 + ("1",) * 3 + ("rad",) * 6


def recording_of(found: Navigation, track: Track) -> Recording:
    """Attitude, velocity, position, rates and specific force with `sigma_` columns; biases; the log's other columns.

    Angles are without jumps of a turn. Rates and forces have their noise and the uncertainty of what was taken off.
    """
    columns = dict(zip(MOTION, np.asarray(track.motion).T, strict=True))
    for name in ("phi", "psi"):
        columns[name] = np.unwrap(columns[name])
    sigma = dict(zip(MOTION, np.asarray(track.motion_std).T, strict=True))
    for names, values, std in (_rates(found, track), _forces(found, track)):
        columns |= dict(zip(names, values.T, strict=True))
        sigma |= dict(zip(names, std.T, strict=True))
    constants = constant_names(found)
    columns |= dict(zip(constants, np.asarray(track.constants).T, strict=True))
    sigma |= dict(zip(constants, np.asarray(track.constants_std).T, strict=True))
    columns |= {f"sigma_{name}": values for name, values in sigma.items()}
    columns |= {name: values for name, values in found.log.others.items() if name not in columns}
    return Recording(found.log.name, found.log.times, columns, found.log.source, units=UNITS)


def constant_names(found: Navigation) -> tuple[str, ...]:
    """Columns of what a track holds for constant."""
    return (*CONSTANTS, *(f"delay_{name}" for name in found.delays))


def _rates(found: Navigation, track: Track) -> tuple[tuple[str, ...], np.ndarray, np.ndarray]:
    constants, std, read = np.asarray(track.constants), np.asarray(track.constants_std), found.rows.rates
    scales = slice(6, 6 + SCALES)
    values = read - by_matrix(constants[:, scales], read) - constants[:, :3]
    wide = std[:, :3] ** 2 + by_matrix(std[:, scales] ** 2, read**2)
    return _RATES, values, np.sqrt(wide + _white(found, "gyro") ** 2)


def _forces(found: Navigation, track: Track) -> tuple[tuple[str, ...], np.ndarray, np.ndarray]:
    constants, std = np.asarray(track.constants), np.asarray(track.constants_std)
    noise = _white(found, "accelerometer")
    return _FORCES, found.rows.forces - constants[:, 3:6], np.sqrt(std[:, 3:6] ** 2 + noise**2)


def _white(found: Navigation, kind: str) -> float:
    """Standard deviation of a sample of white noise of the stated density."""
    noise = found.suite.only(kind).noise
    assert noise is not None
    return noise.density / math.sqrt(float(np.median(np.diff(found.log.times))))


def reference_errors(found: Navigation, reference: Recording) -> dict[str, dict[str, float | str]]:
    """Errors of the smoothed motion against the columns of `MOTION` that a reference on the same clock has.

    `rms` in the channel's unit, and `ratio`, the rms of errors over their standard deviations: one where the bands are
    right. Raises InputError where the two have no channel, or no time, in common.
    """
    motion, std = np.array(found.smoothed.motion), np.asarray(found.smoothed.motion_std)
    motion[:, :3] = np.unwrap(motion[:, :3], axis=0)
    times, errors = found.log.times, {}
    for i, name in enumerate(MOTION):
        if name not in reference.columns:
            continue
        known = reference.column(name)
        inside = np.isfinite(known) & (reference.times >= times[0]) & (reference.times <= times[-1])
        at = reference.times[inside]
        apart = np.interp(at, times, motion[:, i]) - known[inside]
        apart = (apart + np.pi) % (2.0 * np.pi) - np.pi if i < 3 else apart
        if at.size:
            ratio = float(np.sqrt(np.mean((apart / np.interp(at, times, std[:, i])) ** 2)))
            errors[name] = {"rms": float(np.sqrt(np.mean(apart**2))), "ratio": ratio, "unit": UNITS[name]}
    if not errors:
        what = f"has none of {', '.join(MOTION)} in the time of the log"
        raise InputError(reference.source, what, "name its columns so, in the log's clock")
    return errors


def summary(found: Navigation) -> dict[str, Any]:
    """What a program wants to know of a navigation, with plain numbers."""
    track, times = found.smoothed, found.log.times
    units = (*_OF_CONSTANTS, *("s" for _ in found.delays))
    numbers = zip(constant_names(found), np.asarray(track.constants)[-1], np.asarray(track.constants_std)[-1], units,
                  strict=True)  # fmt: skip
    return {
        "schema": 1,
        "name": found.suite.name,
        "log": found.log.source,
        "rule": found.suite.rule,
        "samples": len(times),
        "duration": float(times[-1] - times[0]),
        "start": {"at_rest": found.start.rest, "heading": found.start.heading},
        "origin": found.log.origin,
        "sensors": [one._asdict() | {"verdict": one.verdict} for one in consistency(found)],
        "constants": {n: {"value": float(v), "standard_error": float(e), "unit": u} for n, v, e, u in numbers},
        "sigma": {
            name: {"median": float(np.median(std)), "largest": float(np.max(std)), "unit": UNITS[name]}
            for name, std in zip(MOTION, np.asarray(track.motion_std).T, strict=True)
        },
        "magnetometer": None if found.field is None else found.field._asdict(),
        "unobserved": unobserved(found),
        "findings": [finding.to_json() for finding in found.findings],
    }
