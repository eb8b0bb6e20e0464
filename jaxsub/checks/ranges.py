"""Values that cannot be in their unit."""

import math

import numpy as np

from ..findings import Finding
from ..recording import Recording
from .channels import Channel
from .spans import amount, at_rows, counted, of_run

# beyond these no marine vehicle goes: by quantity, else by unit
_QUANTITIES = {
    "phi": (-2.0 * math.pi, 2.0 * math.pi), "theta": (-2.0 * math.pi, 2.0 * math.pi), "psi": (-1000.0, 1000.0),
    "z": (-1000.0, 12000.0), "depth": (-1000.0, 12000.0), "x": (-1e7, 1e7), "y": (-1e7, 1e7),
    "density": (500.0, 2000.0), "temperature": (-100.0, 400.0), "altitude": (-100.0, 12000.0),
}  # fmt: skip
_UNITS = {"m/s": (-100.0, 100.0), "rad/s": (-100.0, 100.0), "m/s/s": (-2000.0, 2000.0), "rad": (-7.0, 7.0)}
_INSTEAD = {
    "rad": "degrees?", "rad/s": "degrees per second?", "m/s": "cm/s, mm/s or knots?", "m": "mm or cm?",
    "kg/m³": "g/cm³?", "K": "degrees Celsius?", "m/s/s": "mm/s² or counts?",
}  # fmt: skip
# an input in rad/s is a shaft's, and those of small thrusters turn at thousands of revolutions a minute
_SHAFT = (-1e4, 1e4)
_FEW = 0.05  # of the samples: so many may be faults of the sensor, more are a wrong unit
_STEP = (1e-6, 3600.0)  # s: sample intervals of any log of a run


def impossible(recording: Recording, channel: Channel, values: np.ndarray) -> tuple[np.ndarray, list[Finding]]:
    """`values` (samples,) without those that cannot be in their unit.

    A few of a measured channel are masked with a warning; more than 5 %, or any of an input, is an error.
    """
    shaft = channel.role == "held input" and channel.unit == "rad/s"
    limits = _SHAFT if shaft else _QUANTITIES.get(channel.quantity, _UNITS.get(channel.unit))
    if limits is None:
        return values, []
    with np.errstate(invalid="ignore"):
        beyond = (values < limits[0]) | (values > limits[1])
    if not beyond.any():
        return values, []
    worst = float(values[beyond][np.argmax(np.abs(values[beyond]))])
    within = f"{amount(limits[0])} to {amount(limits[1], channel.unit)}"
    said = f"{counted(beyond, values)} beyond {within}, such as {amount(worst, channel.unit)}"
    few = np.count_nonzero(beyond) <= _FEW * np.count_nonzero(np.isfinite(values))
    if few and channel.role == "measured":
        finding = at_rows(
            "impossible-value", "warning", recording, channel, beyond, f"masked {said}", "check the sensor"
        )
        return np.where(beyond, np.nan, values), [finding]
    ask = _INSTEAD.get(channel.unit, "")
    remedy = f"head the column {channel.name}[unit] with its true unit{f' ({ask})' if ask else ''}"
    return values, [at_rows("impossible-value", "error", recording, channel, beyond, said, remedy)]


def sample_interval(recording: Recording) -> list[Finding]:
    """An error where the median time step is no time step of a run."""
    step = float(np.median(np.diff(recording.times)))
    if _STEP[0] <= step <= _STEP[1]:
        return []
    what = f"the median time step is {amount(step, 's')}, outside {amount(_STEP[0])} to {amount(_STEP[1], 's')}"
    ask = "ms or µs?" if step > _STEP[1] else "days or hours?"
    return [of_run("time-step", "error", recording, "t", what, f"head the time t[unit] with its true unit ({ask})")]
