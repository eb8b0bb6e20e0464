"""The picture of the designed manoeuvre: its inputs and responses beside the paper's PRBS, and what each run tells."""

from collections.abc import Mapping
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import SubFigure

from jaxsub.information.design_information import Information
from jaxsub.recording import Recording
from jaxsub.simulation import sampled_states, synthetic
from jaxsub.vehicle import AbstractVehicle

_PANELS = {
    "delta_r": "rudder, °", "delta_er": "right elevator, °", "delta_el": "left elevator, °",
    "r": "yaw rate, °/s", "phi": "roll, °", "theta": "pitch, °", "z": "depth, m",
}  # fmt: skip
_COLOURS = {"PRBS of the paper": "#9a9a9a", "design": "#b5482a"}


def draw(path: Path, vehicle: AbstractVehicle, rows: Mapping[str, tuple[Recording, Information]]) -> None:
    """Write the picture of the manoeuvres `rows` of `vehicle` to `path`."""
    figure = plt.figure(figsize=(13.0, 9.0), layout="constrained")
    left, right = figure.subfigures(1, 2, squeeze=False, width_ratios=(1.45, 1.0))[0]
    axes = left.subplots(len(_PANELS), 1, sharex=True)
    for name, colour in _COLOURS.items():
        (answer,) = synthetic(vehicle, [rows[name][0]], seed=0, noise=False, states=sampled_states)
        for axis, (channel, label) in zip(axes, _PANELS.items(), strict=True):
            values = answer.column(channel)
            held = channel in vehicle.layout.held
            # the deflection of the last sample acts on nothing
            shown = slice(None, -1) if held else slice(None)
            axis.plot(
                answer.times[shown],
                (values if channel == "z" else np.degrees(values))[shown],
                drawstyle="steps-post" if held else "default",
                color=colour,
                lw=1.2,
                label=name,
            )
            axis.set_ylabel(label, fontsize=9)
            axis.grid(alpha=0.25)
    axes[list(_PANELS).index("z")].invert_yaxis()
    axes[0].legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, frameon=False)
    axes[-1].set_xlabel("time, s")
    left.align_ylabels(axes)
    _bars(right, rows)
    figure.savefig(path, dpi=120)
    plt.close(figure)


def _bars(figure: SubFigure, rows: Mapping[str, tuple[Recording, Information]]) -> None:
    order = sorted(rows, key=lambda name: rows[name][1].log_det)
    chosen = [rows[name][1] for name in order]
    reference = rows["PRBS of the paper"][1]
    upper, lower = figure.subplots(2, 1)
    measures = (
        ("information per second (D-criterion), 1/s", [np.exp(i.log_det / len(i.names)) / i.seconds for i in chosen]),
        ("worst relative standard error, %", [100.0 * max(i.standard_errors.values()) for i in chosen]),
    )
    for axis, (label, values) in zip((upper, lower), measures, strict=True):
        axis.barh(order, values, color=[_COLOURS.get(name, "#5b7c99") for name in order])
        axis.set_xlabel(label)
        axis.spines[["top", "right"]].set_visible(False)
        axis.margins(x=0.2)
    for i, found in enumerate(chosen):
        upper.text(measures[0][1][i], i, f" ×{found.gain(reference):.2f}", va="center", fontsize=9)
        lower.text(measures[1][1][i], i, f" {measures[1][1][i]:.1f}", va="center", fontsize=9)
    upper.set_title("gain over the paper's PRBS beside each bar", fontsize=10, loc="left")
