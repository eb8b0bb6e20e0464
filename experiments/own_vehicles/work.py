"""One case from beginning to end: files made, judged, scored; what came of it in one line."""

import tempfile
import traceback
from pathlib import Path

from experiments.concealed_physics import scoring
from experiments.concealed_physics.judge import judge
from jaxsub.cli import session
from jaxsub.vehicle import read_vehicle

from .generate import generate
from .plan import CASES

# level at which the file's numbers are rejected, and relative error of an estimate that is right
_LEVEL, _CLOSE = 0.01, 0.05


def work(name: str) -> dict:
    """The line of the case of that name; it has no `answer` where its files could not be made."""
    session.start()
    case = next(case for case in CASES if case.name == name)
    line = {"case": case.name, "vehicle": case.vehicle, "concealed": case.concealed}
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "files"
        try:
            truth = generate(case, folder)
        except Exception:
            # one case that cannot be made must not end the others; the line says why
            return line | {"why": traceback.format_exc()[-600:]}
        answer = judge(folder)
        improved = folder / "out" / "improved.toml"
        if improved.is_file():
            values = read_vehicle(improved).values()
            answer["values"] = {name: float(values[name]) for name in truth["values"] if name in values}
    return line | {"truth": truth, "answer": answer, "mark": mark(truth, answer)}


def mark(truth: dict, answer: dict) -> str:
    """`right`, `ambiguous` where the effect is among at most four rivals, or `wrong`.

    Where a free number of the file is what is wrong, the right answer names no effect, rejects the file's numbers and
    estimates that one within 5 %.
    """
    if truth["values"]:
        found = answer.get("values", {})
        close = [abs(found.get(name, 0.0) / value - 1.0) < _CLOSE for name, value in truth["values"].items()]
        rejected = answer.get("coefficients_p_value", 1.0) < _LEVEL
        return "right" if answer.get("verdict") == "none" and rejected and all(close) else "wrong"
    if not scoring.right(truth["names"], answer):
        return "wrong"
    return "ambiguous" if answer["verdict"] == "ambiguous" else "right"
