"""One case from beginning to end: files made, judged, scored; what came of it in one line."""

from functools import partial
from pathlib import Path

from experiments.cases import with_files
from experiments.concealed_physics import scoring
from experiments.concealed_physics.judge import judge
from jaxsub.vehicle import read_vehicle

from .generate import generate
from .plan import CASES

# level at which the file's numbers are rejected, and relative error of an estimate that is right
_LEVEL, _CLOSE = 0.01, 0.05


def work(name: str) -> dict:
    """The line of the case of that name; it has no `answer` where its files could not be made."""
    case = next(case for case in CASES if case.name == name)
    line = {"case": case.name, "vehicle": case.vehicle, "concealed": case.concealed}
    return with_files(line, partial(generate, case), _answered)


def _answered(folder: Path, truth: dict) -> dict:
    answer = judge(folder)
    improved = folder / "out" / "improved.toml"
    if improved.is_file():
        values = read_vehicle(improved).values()
        answer["values"] = {name: float(values[name]) for name in truth["values"] if name in values}
    return {"truth": truth, "answer": answer, "mark": mark(truth, answer)}


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
