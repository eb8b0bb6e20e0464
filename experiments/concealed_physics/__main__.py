"""`python -m experiments.concealed_physics --out DIR [--quick | --fresh] [--part CONDITION] [--count N] [--jobs N]`.

Every case is a set of files that conceal physics, and the answer of `jaxsub diagnose`, which sees only them.
`DIR/cases.jsonl` holds a line for each case that is done; an interrupted run goes on where it stopped, and
`results.json` and the figures are drawn from all of its lines. Cases are ordered so that at any time every condition
has been done in proportion. `--fresh` does cases beyond the plan instead, on which no engine was ever corrected. One
engine answers all cases of a folder: where its sources change, the run ends.
"""

import argparse
import json
from functools import partial
from pathlib import Path

from jaxsub.cli import terminal

from ..cases import completed, read
from .assemble import is_right, sets
from .engine import engine, other
from .figures import draw
from .plan import CONDITIONS, ordered
from .work import work

# a process may hold so many compiled programs and no more
_CASES_A_PROCESS = 6


def main() -> None:
    """Do the cases that are missing, and assemble what all lines say."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--quick", action="store_true", help="about a dozen cases")
    which.add_argument("--fresh", action="store_true", help="cases beyond the plan")
    parser.add_argument("--part", choices=list(CONDITIONS), help="this condition alone")
    parser.add_argument("--count", type=int, help="so many cases of each condition")
    parser.add_argument("--skip", type=int, default=0, help="leave out so many cases, the first of the order")
    parser.add_argument("--jobs", type=int, default=1, help="cases at once")
    chosen = parser.parse_args()
    today, which = engine(), "fresh" if chosen.fresh else "quick" if chosen.quick else "planned"
    if begun := other(read(chosen.out / "cases.jsonl"), today):
        parser.error(f"{chosen.out} holds cases of the engine {begun}, and this is {today.commit}")
    parts = [chosen.part] if chosen.part else CONDITIONS
    counts = {c: chosen.count or getattr(CONDITIONS[c], which) for c in parts}
    processes = {"jobs": chosen.jobs, "together": _CASES_A_PROCESS}
    cases = ordered(counts, chosen.fresh)[chosen.skip :]
    answered = partial(work, engine=today)
    results = sets(completed(cases, chosen.out, answered, said, name=lambda case: case.name, **processes))
    (chosen.out / "results.json").write_text(json.dumps(results, indent=1), encoding="utf-8")
    for name, found in results.items():
        draw(found, chosen.out / "figures" / name)
    terminal.note(f"results: {chosen.out / 'results.json'}")


def said(line: dict) -> str:
    """A line for the terminal."""
    if "answer" not in line:
        return f"{line['case']}: {', '.join(line['concealed'])} {line['why'][-80:]}"
    answer = line["answer"]
    names = [entry["effect"] for entry in answer.get("physics", [])]
    mark = "right" if is_right(line, answer) else "WRONG"
    size = f"{line['size']:g} σ" if line["concealed"] else "nothing"
    spent = f"{answer.get('cpu_seconds', 0.0):.0f} s of CPU"
    verdict = answer.get("verdict", "error")
    return f"{line['case']}: {', '.join(line['concealed'])} {size}: {verdict} {names} {mark} {spent}"


if __name__ == "__main__":
    main()
