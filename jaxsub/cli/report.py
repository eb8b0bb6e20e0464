"""`jaxsub report`: the page and figures of a diagnosis, drawn again from what it wrote."""

from pathlib import Path

from ..api.diagnoses import IMPROVED
from ..discrepancy.records.stored import STORED, load_conclusions
from ..errors import InputError
from ..report import write_report
from . import terminal
from .output import redrawn


def run(folder: Path) -> None:
    """Replace `report.html` and `figures/` in `folder`, which `jaxsub diagnose` or `jaxsub demo` wrote."""
    if not folder.is_dir():
        raise InputError(str(folder), "is no folder", "give the --out of a diagnosis")
    conclusions = load_conclusions(folder / STORED)
    if not (folder / IMPROVED).is_file():
        raise InputError(str(folder / IMPROVED), "does not exist", "give the folder as the diagnosis wrote it")
    text = (folder / IMPROVED).read_text(encoding="utf-8")
    with redrawn(folder) as new:
        write_report(conclusions, text, new)
    terminal.emit({"report": str(folder / "report.html")}, lambda: None)
    terminal.note(f"report: {folder / 'report.html'}")
