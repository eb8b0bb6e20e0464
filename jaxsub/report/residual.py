"""The figure of a channel's residual before and after, the first one where a sensor or actuator differs."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from ..discrepancy.records.diagnosis import ChannelQuality, Conclusions, Overlay
from .drawing import (
    BASELINE,
    GREY,
    IMPROVED,
    NARROW,
    PALE,
    WIDE,
    PageWidth,
    Picture,
    drawable,
    new_figure,
    plain_ticks,
    png,
    thin,
)
from .overlay import affected_channels, modelled, telling_overlay
from .text import symbol, unit


class Device(NamedTuple):
    """A sensor or actuator in which the mismatch lies, and the channel whose residual shows it most."""

    place: str
    channel: str


def located_device(diagnosis: Conclusions) -> Device | None:
    """The sensor or actuator that holds most of the mismatch; None where an equation does, or no test run shows it."""
    overlay = telling_overlay(diagnosis)
    place = diagnosis.where[0].where if diagnosis.where else ""
    kind, _, name = place.partition(":")
    if overlay is None or not name:
        return None
    own = name if kind == "sensor" and name in overlay.measured else affected_channels(diagnosis, overlay)[0]
    return Device(place, own)


def draw_residual(diagnosis: Conclusions) -> Picture | None:
    """The residual of the located device's channel, over time and over its modelled value; None without one."""
    device, overlay = located_device(diagnosis), telling_overlay(diagnosis)
    if device is None or overlay is None:
        return None
    alt = f"Residual of {device.channel} in run {overlay.run} before and after, over time and over its modelled value"
    known = diagnosis.quality.get(device.channel)
    wide, narrow = (_render(overlay, device.channel, known, diagnosis.improves, page) for page in (WIDE, NARROW))
    return Picture("residual", alt, wide, narrow)


def _render(overlay: Overlay, channel: str, known: ChannelQuality | None, improved: bool, page: PageWidth) -> bytes:
    shape = (1, 2) if page.columns > 1 else (2, 1)
    figure = new_figure(page.inches, 3.0 * shape[0] + 0.5)
    over_time, over_value = figure.subplots(*shape, squeeze=False).ravel()
    said, sigma = (drawable(unit(known.unit)), known.sigma) if known else ("SI unit", np.nan)
    name = drawable(symbol(channel))
    for values, color in modelled(overlay, channel, improved):
        residual = overlay.measured[channel] - values
        _dots(over_time, overlay.times, residual, color)
        _dots(over_value, values, residual, color)
    over_time.set_xlabel("time (s)")
    over_value.set_xlabel(f"{name} as modelled ({said})" if said else f"{name} as modelled")
    for axes in (over_time, over_value):
        if np.isfinite(sigma):
            axes.axhspan(-2.0 * sigma, 2.0 * sigma, color=PALE, alpha=0.7, linewidth=0)
        axes.axhline(0.0, color=GREY, linewidth=0.7)
        axes.set_ylabel(f"residual of {name} ({said})" if said else f"residual of {name}")
        plain_ticks(axes, x=True, y=True)
    dots = lambda color, label: Line2D([], [], color=color, marker=".", markersize=7, linestyle="none", label=label)
    handles = [dots(BASELINE, "baseline model"), *([dots(IMPROVED, "improved model")] if improved else [])]
    handles.append(Line2D([], [], color=PALE, linewidth=6, label="±2σ"))
    figure.legend(handles=handles, loc="outside lower left", ncols=3)
    figure.suptitle(f"Not fitted: run {drawable(overlay.run, 40)}", x=0.01, ha="left", fontsize=10.5)
    return png(figure)


def _dots(axes: Axes, across: Float[np.ndarray, " k"], residual: Float[np.ndarray, " k"], color: str) -> None:
    axes.plot(*thin(across, residual), ".", color=color, markersize=2.4, alpha=0.6)
