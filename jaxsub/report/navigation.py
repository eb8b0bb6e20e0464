"""The page of a navigation: angles with bands, innovations by sensor, the track, and what no sensor shows."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from ..navigation.navigate import Navigation
from .drawing import (
    GREY,
    IMPROVED,
    INK,
    PALE,
    Picture,
    drawable,
    new_figure,
    panels,
    plain_ticks,
    png,
    style,
    thin,
    write_figures,
)
from .page import environment

_MOTION = (("roll (°)", 0), ("pitch (°)", 1), ("yaw (°)", 2), ("u (m/s)", 3), ("v (m/s)", 4), ("w (m/s)", 5))
_BAND = 2.0  # standard deviations


def write_navigation_report(found: Navigation, content: dict[str, Any], folder: Path) -> None:
    """Write `report.html`, which needs no other file, and `figures/*.png` into `folder`.

    They show the motion `found`; `content` is its summary, as `navigation.json` has it.
    """
    with style():
        pictures = {picture.name: picture for picture in (_motion(found), _track(found), _innovations(found))}
    write_figures(pictures.values(), folder)
    page = environment().get_template("navigation.html.j2").render(found=content, pictures=pictures)
    (folder / "report.html").write_text(page, encoding="utf-8")


def _motion(found: Navigation) -> Picture:
    """Angles and body velocity, smoothed, with their bands."""
    times = found.log.times - found.log.times[0]
    motion, std = np.array(found.smoothed.motion), np.asarray(found.smoothed.motion_std)
    motion[:, :3] = np.degrees(np.unwrap(motion[:, :3], axis=0))
    scale = np.where(np.arange(9) < 3, np.degrees(1.0), 1.0)
    figure = new_figure(9.8, 6.0)
    for (label, i), (axes,) in zip(_MOTION, panels(figure, len(_MOTION), 2), strict=True):
        band = _BAND * scale[i] * std[:, i]
        (at, low), (_, high) = thin(times, motion[:, i] - band), thin(times, motion[:, i] + band)
        axes.plot(at, low, color=GREY, linewidth=0.6)
        axes.plot(thin(times, motion[:, i] + band)[0], high, color=GREY, linewidth=0.6)
        axes.plot(*thin(times, motion[:, i]), color=IMPROVED)
        axes.set_ylabel(label)
        plain_ticks(axes, x=True, y=True)
    return Picture("motion", "Angles and velocity over time with bands of two standard deviations", png(figure))


def _track(found: Navigation) -> Picture:
    """North over east, and depth over time."""
    times = found.log.times - found.log.times[0]
    motion, std = np.asarray(found.smoothed.motion), np.asarray(found.smoothed.motion_std)
    figure = new_figure(9.8, 3.6)
    left, right = figure.subplots(1, 2)
    step = max(1, len(times) // 3000)
    left.plot(motion[::step, 7], motion[::step, 6], color=IMPROVED)
    left.set(xlabel="east (m)", ylabel="north (m)")
    left.set_aspect("equal", adjustable="datalim")
    for name, i, color in (("north", 6, INK), ("east", 7, IMPROVED), ("down", 8, GREY)):
        right.plot(*thin(times, std[:, i]), color=color, label=name)
    right.set(xlabel="time (s)", ylabel="σ of position (m)")
    right.set_ylim(bottom=0.0)
    right.legend()
    for axes in (left, right):
        plain_ticks(axes, x=True, y=True)
    return Picture("track", "The track, and the standard deviation of the position over time", png(figure))


def _innovations(found: Navigation) -> Picture:
    """Each sensor's innovations over their standard deviations."""
    times = found.log.times - found.log.times[0]
    names = {sensor.name for sensor in found.suite.aiding}
    sensors = [(name, block) for name, block in found.channels.items() if name in names]
    figure = new_figure(9.8, 1.8 * -(-max(len(sensors), 1) // 2) + 0.6)
    for (name, block), (axes,) in zip(sensors, panels(figure, len(sensors), 2), strict=True):
        _innovation(axes, times, np.where(found.used[:, block], found.innovations[:, block], np.nan))
        axes.set_title(drawable(name), fontweight="bold")
    return Picture("innovations", "Innovations of each sensor over their standard deviations", png(figure))


def _innovation(axes: Axes, times: np.ndarray, values: np.ndarray) -> None:
    axes.axhspan(-_BAND, _BAND, color=PALE, alpha=0.7, linewidth=0)
    for column in values.T:
        axes.plot(*thin(times, column), ".", color=IMPROVED, markersize=1.6)
    axes.set_ylabel("innovation/σ")
    plain_ticks(axes, x=True, y=True)
