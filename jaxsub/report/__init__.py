"""The report: figures, tables and one self-contained page that shows a diagnosis; the only room that draws."""

from .page import write_report

__all__ = ["write_report"]
