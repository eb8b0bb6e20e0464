"""The report: figures, tables and one self-contained page that shows a diagnosis; the only room that draws."""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .checked_runs import draw_checked_runs
    from .drawing import Picture, write_figures
    from .figures import draw
    from .navigation import write_navigation_report
    from .overlay import draw_run
    from .page import write_report
    from .sweeps import sweep_pictures

__all__ = [
    "Picture",
    "draw",
    "draw_checked_runs",
    "draw_run",
    "sweep_pictures",
    "write_figures",
    "write_navigation_report",
    "write_report",
]

_MODULES = {
    "Picture": "drawing",
    "draw": "figures",
    "draw_checked_runs": "checked_runs",
    "draw_run": "overlay",
    "sweep_pictures": "sweeps",
    "write_figures": "drawing",
    "write_navigation_report": "navigation",
    "write_report": "page",
}


def __getattr__(name: str) -> Any:
    """A public name, imported at its first use: commands that draw nothing need no Matplotlib."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    found = globals()[name] = getattr(importlib.import_module(f".{_MODULES[name]}", __name__), name)
    return found
