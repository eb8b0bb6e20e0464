"""The figure of a run's channels with what checks found in them."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from ..findings import Finding
from ..recording import Recording
from .drawing import (
    BASELINE,
    IMPROVED,
    LOCATED,
    NARROW,
    PALE,
    WIDE,
    PageWidth,
    Picture,
    drawable,
    new_figure,
    panels,
    plain_ticks,
    png,
    style,
    thin,
)
from .text import symbol, unit

_COLORS = {"error": BASELINE, "warning": LOCATED, "note": PALE}
_MOST_RUNS = 20
_NARROWEST = 0.004  # of the run: what is shorter could not be seen


def draw_checked_runs(
    recordings: Sequence[Recording], channels: Sequence[tuple[str, str]], findings: Sequence[Finding]
) -> list[Picture]:
    """For each of `recordings`, its `channels` (name and unit) over time with what `findings` say of them shaded.

    The first 20 runs are drawn.
    """
    pictures = []
    with style():
        for index, recording in enumerate(recordings[:_MOST_RUNS], 1):
            own = [finding for finding in findings if finding.where == recording.source]
            shown = [(name, si) for name, si in channels if name in recording.columns]
            if shown:
                alt = f"Channels of {recording.name} over time with {len(own)} findings"
                images = (_render(recording, shown, own, page) for page in (WIDE, NARROW))
                pictures.append(Picture(f"run-{index}", alt, *images))
    return pictures


def _render(
    recording: Recording, channels: Sequence[tuple[str, str]], findings: Sequence[Finding], page: PageWidth
) -> bytes:
    columns = min(page.columns, len(channels))
    rows = -(-len(channels) // columns)
    figure = new_figure(page.inches, 1.6 * rows + 0.9)
    for (name, si), (axes,) in zip(channels, panels(figure, len(channels), columns), strict=True):
        _channel(axes, recording, name, [finding for finding in findings if finding.channel in (name, "t")])
        axes.set_title(drawable(symbol(name)), fontweight="bold")
        axes.set_ylabel(unit(si) or "SI unit")
    figure.suptitle(f"As recorded: {drawable(recording.name, 60)}", x=0.01, ha="left", fontsize=10.5)
    handles: list[Line2D | Patch] = [Line2D([], [], color=IMPROVED, label="recorded")]
    handles += [Patch(color=_COLORS[s], alpha=0.6, label=s) for s in _COLORS if any(f.severity == s for f in findings)]
    figure.legend(handles=handles, loc="outside lower left", ncols=4)
    return png(figure)


def _limit(axes: Axes, times: np.ndarray, values: np.ndarray, spans: Sequence[tuple[float, float]]) -> None:
    """Limits that show the samples outside of the `spans`: far values are cut off, and shaded all the same."""
    measured = np.isfinite(values)
    sound = measured & ~np.any([(times >= first) & (times <= last) for first, last in spans], axis=0)
    shown = values[sound if sound.any() else measured]
    if shown.size:
        low, high = np.percentile(shown, (1.0, 99.0))
        reach = max(float(high - low), 1e-12)
        low, high = max(float(shown.min()), low - reach), min(float(shown.max()), high + reach)
        axes.set_ylim(low - 0.05 * reach, high + 0.05 * reach)


def _channel(axes: Axes, recording: Recording, name: str, findings: Sequence[Finding]) -> None:
    start, least = float(recording.times[0]), _NARROWEST * recording.duration
    values = recording.columns[name]
    for finding in findings:
        for first, last in finding.times:
            middle, half = 0.5 * (first + last) - start, 0.5 * max(last - first, least)
            axes.axvspan(middle - half, middle + half, color=_COLORS[finding.severity], alpha=0.4, linewidth=0)
    times, drawn = thin(recording.times - start, values)
    axes.plot(times, drawn, color=IMPROVED, linewidth=0.8)
    _limit(axes, recording.times, values, [span for finding in findings for span in finding.times])
    said = ", ".join(dict.fromkeys(finding.check for finding in findings if finding.channel == name))
    if said:
        axes.text(0.99, 0.97, drawable(said, 50), transform=axes.transAxes, ha="right", va="top", fontsize=7.5)
    plain_ticks(axes, x=True, y=True)
