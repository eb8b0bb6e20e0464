"""The picture of one effect: what drives the body above, and below what a sensor shows with the effect and without."""

from pathlib import Path

import numpy as np

from jaxsub.effects import CHANNEL_UNITS
from jaxsub.recording import Recording
from jaxsub.report.drawing import BASELINE, GREY, IMPROVED, INK, LOCATED, new_figure, png, style
from jaxsub.vehicle import AbstractVehicle

_LINES = (
    {"color": INK},
    {"color": GREY, "linestyle": (0, (4, 1.5))},
    {"color": GREY, "linestyle": (0, (1, 1))},
    {"color": LOCATED, "linestyle": "-"},
)
_DEGREES = {"rad": "°", "rad/s": "°/s"}


def draw(
    path: Path, channel: str, drive: Recording, vehicle: AbstractVehicle, plain: np.ndarray, changed: np.ndarray
) -> None:
    """Write the figure to `path`."""
    t = drive.times
    unit = CHANNEL_UNITS.get(channel, "")
    scale = np.rad2deg(1.0) if unit in _DEGREES else 1.0
    with style():
        figure = new_figure(5.6, 2.7)
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=(1.0, 2.4))
        for (actuator, column), line in zip(vehicle.layout.inputs, _LINES, strict=False):
            command = drive.column(column)
            largest = float(np.abs(command).max())
            above.plot(t, command / largest, **line, lw=0.9, label=actuator.replace("_", " "), drawstyle="steps-post")
        above.set_yticks([-1.0, 0.0, 1.0], ["", "0", ""])
        above.set_ylabel("inputs")
        above.legend(loc="upper left", bbox_to_anchor=(0.0, 1.45), ncol=4, fontsize=7, handlelength=1.2, borderpad=0.0)
        below.plot(t, scale * plain, color=BASELINE, label="without")
        below.plot(t, scale * changed, color=IMPROVED, label="with")
        below.set_ylabel(f"{channel} [{_DEGREES.get(unit, unit) or '1'}]")
        below.set_xlabel("t [s]")
        if channel == "z":
            below.invert_yaxis()
        below.legend(loc="lower right", bbox_to_anchor=(1.0, 0.97), ncol=2, borderpad=0.0)
        figure.align_ylabels()
        path.write_bytes(png(figure))
