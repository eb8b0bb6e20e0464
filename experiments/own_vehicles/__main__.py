"""`python -m experiments.own_vehicles --out DIR [--quick] [--part CASE] [--jobs N]`.

Every case is a vehicle of the catalogue and recordings that conceal one effect, and the answer of `jaxsub diagnose`,
which sees only the files. Each runs in a process of its own. `DIR/cases.jsonl` holds a line for each case that is done;
an interrupted run goes on where it stopped, and `results.json` and `answers.png` are made from all of its lines.
"""

import argparse
import json
from pathlib import Path

from experiments.cases import completed
from experiments.concealed_physics.scoring import rate
from jaxsub.cli import terminal

from .figure import draw
from .plan import CASES, QUICK
from .work import work


def main() -> None:
    """Do the cases that are missing, and assemble what all lines say."""
    parser = argparse.ArgumentParser(prog="python -m experiments.own_vehicles", description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--quick", action="store_true", help=f"the first {QUICK} cases")
    parser.add_argument("--part", choices=[case.name for case in CASES], help="this case alone")
    parser.add_argument("--jobs", type=int, default=1, help="cases at once")
    chosen = parser.parse_args()
    asked = [case.name for case in CASES[: QUICK if chosen.quick else None] if chosen.part in (None, case.name)]
    results = assemble(completed(asked, chosen.out, work, said, name=str, jobs=chosen.jobs))
    (chosen.out / "results.json").write_text(json.dumps(results, indent=1, ensure_ascii=False), encoding="utf-8")
    draw(results, chosen.out / "answers.png")
    terminal.note(f"results: {chosen.out / 'results.json'}")


def said(line: dict) -> str:
    """A line for the terminal."""
    if "answer" not in line:
        return f"{line['case']}: {line['why'][-80:]}"
    answer = line["answer"]
    names = ", ".join(entry["effect"] for entry in answer.get("physics", []))
    verdict = answer.get("verdict", answer.get("error", ""))
    return f"{line['case']}: {verdict} {names} {line['mark']} {answer.get('seconds', 0.0):.0f} s"


def assemble(lines: list[dict]) -> dict:
    """All cases in the order of the plan, how many are right, and those that could not be made."""
    order = [case.name for case in CASES]
    judged = sorted((line for line in lines if "answer" in line), key=lambda line: order.index(line["case"]))
    return {
        "right": rate(line["mark"] == "right" for line in judged),
        "right_or_ambiguous": rate(line["mark"] != "wrong" for line in judged),
        "cases": judged,
        "not_made": [line for line in lines if "answer" not in line],
        "not_run": [name for name in order if name not in [line["case"] for line in lines]],
    }


if __name__ == "__main__":
    main()
