"""The report: figures, tables and one self-contained page that shows a diagnosis; the only room that draws."""

from .checked_runs import draw_checked_runs
from .drawing import Picture
from .figures import draw
from .page import write_report
from .sweeps import sweep_pictures

__all__ = ["Picture", "draw", "draw_checked_runs", "sweep_pictures", "write_report"]
