"""What figures to explore are made of: a store of arrays, panels of Bokeh, and what of the store each panel shows.

A figure's arrays lie in one store by name. A choice of a run or channel fills the names of what is shown, and
`explorers.js` puts that into the figure.
"""

import dataclasses
import json
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from markupsafe import Markup

from ..arrays import single
from .drawing import GREY, PALE

# Bokeh takes two seconds to import, and is imported by what draws with it
if TYPE_CHECKING:
    from bokeh.models import ColumnDataSource, LayoutDOM

# float32 values of all arrays of a figure: an eighth of a page's 3 MB once they are text
_MOST_VALUES = 70_000
_LEAST, _MOST = 100, 2000  # points of one line
Tips = list[tuple[str, str]]


@dataclasses.dataclass(frozen=True)
class Choice:
    """What a reader chooses: its `name` in patterns, the options as text, and the one that is shown first."""

    name: str
    options: list[str]
    first: int


@dataclasses.dataclass(frozen=True)
class Explorer:
    """A figure with its choices. `data` is what `explorers.js` embeds, as JSON that may stand in a script element."""

    name: str
    choices: list[Choice]
    data: Markup


def script() -> str:
    """Bokeh's script."""
    from bokeh.resources import Resources

    return Resources(mode="inline", components=["bokeh"]).js_raw[0]


class Drawing:
    """A figure in the making: what is stored, and which property of which model shows what of it.

    **Fields**

    - `runs`: how many there is room for. `longest`: how many points a line may have.
    """

    def __init__(self, name: str, runs: int, arrays: int) -> None:
        """For as many of `runs` as there is room for, each of so many `arrays`."""
        self.name, self.runs = name, max(1, min(runs, _MOST_VALUES // (_LEAST * arrays)))
        self.longest = int(np.clip(_MOST_VALUES // (self.runs * arrays), _LEAST, _MOST))
        self.store: dict[str, Any] = {}
        self.bindings: list[tuple[str, str, str | dict[str, str]]] = []

    def keep(self, place: str, **values: np.ndarray | str | float | Tips) -> None:
        """Store arrays, labels, numbers and lines of text under the pointer as `place/NAME`."""
        from bokeh.models import PlainText

        for key, value in values.items():
            # seconds since 1970 need more digits
            kept = single(value) if isinstance(value, np.ndarray) and key != "time" else value
            # plain, so that no name is read as a formula
            self.store[f"{place}/{key}"] = PlainText(text=kept) if isinstance(kept, str) else kept

    def source(self, name: str, columns: Mapping[str, str]) -> "ColumnDataSource":
        """A source whose columns follow patterns such as `{run}/{channel}/baseline`."""
        from bokeh.models import ColumnDataSource

        self.bindings.append((name, "data", dict(columns)))
        return ColumnDataSource(data={key: [] for key in columns}, name=name)

    def panel(self, name: str, x: str, y: str | None, height: int, **settings: Any) -> Any:
        """Axes with a label `x`, and the one `y`: a pattern, or fixed where it has no braces."""
        from bokeh.models import PlainText, Span
        from bokeh.plotting import figure

        drawn = figure(
            name=name, height=height, sizing_mode="stretch_width", min_width=280, tools="pan,box_zoom,wheel_zoom,reset",
            active_drag="box_zoom", active_scroll=None, toolbar_location="above", output_backend="canvas", **settings,
        )  # fmt: skip
        drawn.toolbar.logo = None
        for axis, label in ((drawn.xaxis[0], x), (drawn.yaxis[0], y)):
            axis.axis_label_text_font_style = "normal"
            if label and "{" in label:
                axis.name = f"{name}-{type(axis).__name__}-{label}"
                self.bindings.append((axis.name, "axis_label", label))
            elif label:
                axis.axis_label = PlainText(text=label)
        drawn.add_layout(Span(location=0.0, dimension="width", line_color=GREY, line_width=0.7))
        return drawn

    def band(self, panel: Any, low: str, high: str) -> None:
        """A grey band between two stored numbers."""
        from bokeh.models import BoxAnnotation

        box = BoxAnnotation(
            fill_color=PALE, fill_alpha=0.6, line_color=None, level="underlay", name=f"{panel.name}-band"
        )
        panel.add_layout(box)
        self.bindings += [(str(box.name), "bottom", low), (str(box.name), "top", high)]

    def finished(self, choices: Sequence[Choice], layout: "LayoutDOM") -> Explorer:
        """The explorer of a layout of panels, which shows the first options."""
        from bokeh.core.types import ID
        from bokeh.embed import json_item

        chosen = {choice.name: choice.first for choice in choices}
        at = lambda pattern: self.store.get(pattern.format(**chosen))
        for name, key, pattern in self.bindings:
            model = layout.select_one({"name": name})
            value = at(pattern) if isinstance(pattern, str) else _padded({c: at(one) for c, one in pattern.items()})
            setattr(model, key, value)
        layout.tags = [self.store, [list(binding) for binding in self.bindings]]
        text = json.dumps(json_item(layout, ID(f"plot-{self.name}"))).replace("<", "\\u003c")
        return Explorer(self.name, list(choices), Markup(text))


def _padded(columns: Mapping[str, np.ndarray | None]) -> dict[str, np.ndarray]:
    """Columns of one length: what is not there is missing at every place."""
    length = max((len(values) for values in columns.values() if values is not None), default=0)
    missing = np.full(length, np.nan, np.float32)
    return {name: missing if values is None else values for name, values in columns.items()}


def tips(x: tuple[str, str, str], columns: Iterable[str], unit: str) -> Tips:
    """What is shown under the pointer: of the column `x`, with its label and unit, and of `columns` in their `unit`."""
    column, label, own = x
    named = ((label, column, own), *((name.replace("_", " "), name, unit) for name in columns))
    return [(said, f"@{name}{{%.4g}} {of}".rstrip()) for said, name, of in named]


def lines(
    made: Drawing,
    panel: Any,
    source: "ColumnDataSource",
    x: str,
    columns: Mapping[str, str],
    shown: str,
    dots: Sequence[str] = (),
) -> None:
    """Each of `columns` with its colour over `x`, as a line or as `dots`.

    Under the pointer is what the pattern `shown` leads to, by `tips`: values with their units.
    """
    from bokeh.models import HoverTool

    for name, color in columns.items():
        label = name.replace("_", " ")
        if name in dots:
            drawn = panel.scatter(x, name, source=source, size=3.5, color=color, alpha=0.6, legend_label=label)
        else:
            drawn = panel.line(x, name, source=source, color=color, line_width=1.6, legend_label=label)
    formatters: dict[str, Any] = {f"@{name}": "printf" for name in (x, *columns)}
    mode = "mouse" if dots and len(dots) == len(columns) else "vline"
    hover = HoverTool(name=f"{panel.name}-hover", renderers=[drawn], formatters=formatters, mode=mode)
    made.bindings.append((str(hover.name), "tooltips", shown))
    panel.add_tools(hover)
    panel.legend.click_policy = "hide"
    panel.legend.orientation = "horizontal"
    # so narrow that it fits a telephone
    panel.legend.ncols, panel.legend.spacing, panel.legend.label_text_font_size = 2, 0, "12px"
    panel.legend.location = "left"
    panel.legend.margin = panel.legend.padding = 0
    panel.legend.border_line_color = None
    panel.add_layout(panel.legend[0], "below")
