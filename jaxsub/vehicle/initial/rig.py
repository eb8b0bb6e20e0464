"""A rig from the columns of its log: coordinates, drives, and numbers by regression on differences."""

import json
import re

import numpy as np

from ...errors import InputError
from ...recording import Recording
from ...units import si_unit
from .file import Estimate, number

# units and names of what drives a rig; anything else that moves is a coordinate
_DRIVE_UNITS = ("V", "A", "N", "N*m")
_DRIVES = r"u|.*(drive|force|torque|moment|volt|voltage|current|motor|pwm|command|cmd|valve|pump|input)(_.*|\d*)"
_FEWEST = 20  # samples
_WINDOW, _ORDER = 11, 3  # samples and degree of the polynomial that derivatives are taken from
_RATE = "_rate"


def rig_file(log: Recording) -> tuple[str, list[str]]:
    """The text of a mechanism's file for a `log`, and the columns that it does not use.

    Columns with the name or the unit of a drive are inputs, all others that change are coordinates, and `q_rate` beside
    `q` its rate. Damping, stiffness, gains and constants are those of least squares of each coordinate's second
    derivative, with the inertia 1; a standard deviation as large as each number stands beside it. Damping is taken
    positive. Derivatives are those of local polynomials, which noise makes smaller than they are.
    Source: Savitzky and Golay (1964); Ljung (1999), §7.

    **Raises** `InputError` for a log without a coordinate, and for one too short.
    """
    moving = [name for name, values in log.columns.items() if np.nanmax(values) > np.nanmin(values)]
    drives = [name for name in moving if _is_drive(log, name) and re.fullmatch(r"\w+", name)]
    words = [name for name in moving if name not in drives and re.fullmatch(r"[A-Za-z]\w*", name)]
    coordinates = [name for name in words if not (name.endswith(_RATE) and name.removesuffix(_RATE) in words)]
    if not coordinates:
        remedy = "head the measured coordinate with a word such as x, and a drive with a unit such as u[V]"
        raise InputError(log.source, "has no column of a coordinate that changes", remedy)
    outputs = [name for q in coordinates for name in (q, f"{q}{_RATE}") if name in words]
    lines = [
        "# Begun by `jaxsub init rig` from the columns of a log, which may have any consistent units.",
        "# The inertia is 1, so that damping, stiffness and gains are per unit of it. Numbers are by least squares on",
        "# differences of the log, each with itself for its standard deviation.",
        "# Delete the coordinates and numbers that are not of interest.",
        "schema = 1",
        'name = "Rig"',
        'kind = "mechanism"',
        f"dof = {json.dumps(coordinates)}",
        "[coefficients]",
    ]
    for q in coordinates:
        lines.append(f"I_{q} = {{ value = 1.0, fixed = true }}")
        found = _regressed(log, q, drives)
        lines += [f"{name} = {Estimate.within(1.0, value).toml()}" for name, value in found.items() if value != 0.0]
    lines += ["[inputs]", *(f"{name} = {json.dumps(name)}" for name in drives), "[outputs]"]
    lines += [f'{name}.sigma = "estimate"' for name in outputs]
    used = {*drives, *outputs}
    return "\n".join(lines) + "\n", [name for name in log.columns if name not in used]


def _is_drive(log: Recording, name: str) -> bool:
    return log.units.get(name, "") in map(si_unit, _DRIVE_UNITS) or re.fullmatch(_DRIVES, name.lower()) is not None


def _regressed(log: Recording, q: str, drives: list[str]) -> dict[str, float]:
    """Damping, stiffness, gains and constant of a coordinate, by name.

    **Raises** `InputError` for a log with fewer samples of it than local polynomials need.
    """
    from scipy.signal import savgol_filter

    there = np.isfinite(log.columns[q])
    times, place = log.times[there], log.columns[q][there]
    if len(times) < _FEWEST:
        raise InputError(f"{log.source}, column {q!r}", f"has {len(times)} samples", f"give {_FEWEST} or more")
    step = float(np.median(np.diff(times)))
    even = np.arange(times[0], times[-1], step)
    smooth = lambda values, k=0: np.asarray(savgol_filter(values, _WINDOW, _ORDER, deriv=k, delta=step))
    derivative = lambda k: smooth(np.interp(even, times, place), k)
    # drives are smoothed as the coordinate is, so that the equation holds between what is smoothed
    held = [smooth(log.columns[name][np.searchsorted(log.times, even, side="right") - 1]) for name in drives]
    regressors = np.stack([-derivative(1), -derivative(0), *held, np.ones(len(even))], axis=1)
    # local polynomials have no whole window at the ends
    inside = slice(_WINDOW, -_WINDOW)
    solved = np.linalg.lstsq(regressors[inside], derivative(2)[inside], rcond=None)[0]
    # a rig dissipates: damping that comes out negative is that of noise, and a fit that begins there diverges
    solved[0] = abs(solved[0])
    names = (f"D_{q}", f"K_{q}", *(f"B_{q}_{name}" for name in drives), f"F_{q}")
    return {name: float(number(value)) for name, value in zip(names, solved, strict=True)}
