"""What all figures share: colours, fonts, thinning of long traces, and the way to PNG.

Only matplotlib's object interface is used and its settings hold inside `style()` alone, so that a program which calls
us keeps its own.
"""

import contextlib
import dataclasses
import functools
import io
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.font_manager import findfont, get_font
from matplotlib.ticker import FuncFormatter
from PIL import Image

from .text import number

FONT = "DejaVu Sans"  # comes with matplotlib, and has the Greek letters
# Okabe and Ito's colours, which the common kinds of colour blindness keep apart.
INK, GREY, PALE = "#1d2733", "#6b7683", "#d5dade"
BASELINE, IMPROVED, LOCATED = "#d55e00", "#0072b2", "#e69f00"
_DPI = 160
LONGEST = 3000  # points of one line; more cannot be seen

_STYLE: dict[Any, Any] = {
    "font.family": FONT,
    "font.size": 9.0,
    "text.color": INK,
    "text.usetex": False,
    "text.parse_math": False,  # a `$` in a name is a `$`
    "axes.edgecolor": GREY,
    "axes.grid": False,  # whatever the caller has
    "axes.labelcolor": INK,
    "axes.labelsize": 9.0,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlelocation": "left",
    "axes.titlesize": 9.5,
    "axes.titley": 1.0,  # no axis has ticks above it, and matplotlib need not look for them
    "axes.unicode_minus": True,
    "xtick.color": GREY,
    "ytick.color": GREY,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "lines.linewidth": 1.1,
    "path.simplify": True,
}


class PageWidth(NamedTuple):
    """How wide a figure of panels is on its page, and how many panels stand side by side."""

    inches: float
    columns: int


WIDE, NARROW = PageWidth(9.8, 2), PageWidth(4.7, 1)


@dataclasses.dataclass(frozen=True)
class Picture:
    """One figure: its file name without suffix, what it shows in words, and the PNG; `narrow` is set for a phone.

    A notebook shows it as the last value of a cell.
    """

    name: str
    alt: str
    png: bytes = dataclasses.field(repr=False)
    narrow: bytes | None = dataclasses.field(default=None, repr=False)

    def _repr_png_(self) -> bytes:
        return self.png


def write_figures(pictures: Iterable[Picture], folder: Path) -> None:
    """Write each of `pictures` as `figures/NAME.png` into `folder`."""
    figures = folder / "figures"
    figures.mkdir(parents=True, exist_ok=True)
    for picture in pictures:
        (figures / f"{picture.name}.png").write_bytes(picture.png)


def style() -> contextlib.AbstractContextManager[None]:
    """A context in which our figures are drawn."""
    return matplotlib.rc_context(_STYLE)


def new_figure(width: float, height: float) -> Figure:
    """An empty figure (inches) that belongs to nobody's window system."""
    return Figure(figsize=(width, height), layout="constrained", facecolor="white")


def png(figure: Figure) -> bytes:
    """The figure as a PNG, sharp on a screen with two pixels a point."""
    figure.set_dpi(_DPI)
    canvas = FigureCanvasAgg(figure)
    if engine := figure.get_layout_engine():
        engine.execute(figure)
    figure.set_layout_engine("none")
    # after the layout, which would place each label of a column once for all others and comes to the same margins
    figure.align_ylabels()
    canvas.draw()
    image = Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3].copy())
    buffer = io.BytesIO()
    # With few colours the page is a third as large, and encoding takes half as long.
    image.quantize(64, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE).save(buffer, "png", dpi=(_DPI, _DPI))
    return buffer.getvalue()


def thin(times: np.ndarray, values: np.ndarray, longest: int = LONGEST) -> tuple[np.ndarray, np.ndarray]:
    """At most `longest` of the finite samples, in order and with every visible peak (`thinned`)."""
    kept = thinned(values, longest)
    return times[kept], values[kept]


def thinned(values: np.ndarray, longest: int = LONGEST) -> np.ndarray:
    """The places of at most `longest` finite `values`, in order.

    Of each stretch of equal sample count the smallest and the largest value stay, so that extremes survive.
    """
    kept = np.flatnonzero(np.isfinite(values))
    if kept.size > longest:
        stretches = np.array_split(kept, longest // 2)
        ends = [(part[np.argmin(values[part])], part[np.argmax(values[part])]) for part in stretches]
        kept = np.unique(ends)
    return kept


def drawable(text: str, longest: int = 40) -> str:
    """`text` as a figure can show it: shortened, and with a box for what the font has no glyph for."""
    text = text if len(text) <= longest else f"{text[: longest - 1]}…"
    return "".join(letter if _has_glyph(letter) else "□" for letter in text)


def plain_ticks(axes: Axes, *, x: bool = False, y: bool = False) -> None:
    """Tick labels as plain numbers on the chosen axes; matplotlib's own use offsets or mathematical text."""
    formatter = FuncFormatter(lambda value, _: number(value, 3))
    for axis in ([axes.xaxis] if x else []) + ([axes.yaxis] if y else []):
        axis.set_major_formatter(formatter)


def panels(figure: Figure, count: int, columns: int, heights: tuple[float, ...] = (1.0,)) -> Iterator[list[Axes]]:
    """For each of `count` panels its axes, one below the other with relative `heights`; time runs along all of them."""
    rows, per_panel = -(-count // columns), len(heights)
    grid = figure.subplots(rows * per_panel, columns, sharex=True, squeeze=False, height_ratios=heights * rows)
    for index in range(rows * columns):
        row, column = divmod(index, columns)
        own = list(grid[row * per_panel : (row + 1) * per_panel, column])
        if index >= count:
            for axes in own:
                axes.remove()
            continue
        if index + columns >= count:  # nothing below it
            own[-1].set_xlabel("time (s)")
            own[-1].tick_params(labelbottom=True)
        yield own


@functools.cache
def _has_glyph(letter: str) -> bool:
    return letter.isprintable() and get_font(findfont(FONT)).get_char_index(ord(letter)) != 0
