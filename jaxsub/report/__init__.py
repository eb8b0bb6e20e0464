"""The report: figures, tables and one self-contained page that shows a diagnosis; the only room that draws."""

from .drawing import Picture
from .figures import draw
from .page import write_report
from .sweeps import sweep_pictures

__all__ = ["Picture", "draw", "sweep_pictures", "write_report"]
