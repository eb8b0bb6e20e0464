"""`python -m experiments.settings --out DIR [--quick] [--names A,B] [--jobs N]`: settings halved and doubled.

Every constant of `jaxsub/discrepancy/settings.py` that can change a verdict is halved and doubled, and cases of
`experiments.concealed_physics` are judged with it. `DIR/cases.jsonl` holds a line for each case that is done; an
interrupted run goes on where it stopped. One engine answers all cases of a folder: where its sources change, the run
ends.
"""

import argparse
import json
from functools import partial
from pathlib import Path

from jaxsub.cli import session, terminal

from ..cases import completed, read
from ..concealed_physics import scoring
from ..concealed_physics.engine import engine, other
from .assemble import assemble, said
from .trials import CASES, QUICK, described, trials
from .work import made, worked

# a process may hold so many compiled programs and no more
_TOGETHER = 6


def main() -> None:
    """Judge the cases that are missing, and assemble what all lines say."""
    parser = argparse.ArgumentParser(prog="python -m experiments.settings", description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--quick", action="store_true", help=f"{len(QUICK)} cases instead of {len(CASES)}")
    parser.add_argument("--names", help="these settings alone, as A,B")
    parser.add_argument("--jobs", type=int, default=1, help="cases at once")
    chosen = parser.parse_args()
    every = [*described()]
    names = chosen.names.split(",") if chosen.names else every
    if unknown := sorted({*names} - {*every}):
        parser.error(f"settings.py has no {', '.join(unknown)}; it has {', '.join(every)}")
    today = engine()
    if begun := other(read(chosen.out / "cases.jsonl"), today):
        parser.error(f"{chosen.out} holds cases of the engine {begun}, and this is {today.commit}")
    session.start()
    todo = trials(QUICK if chosen.quick else CASES, names)
    for case in {trial.case for trial in todo}:
        made(case, chosen.out / "files")
    work = partial(worked, engine=today, files=chosen.out / "files")
    name = lambda trial: trial.name
    lines = completed(todo, chosen.out, work, shown, name=name, jobs=chosen.jobs, together=_TOGETHER)
    (chosen.out / "results.json").write_text(json.dumps(assemble(lines), indent=1), encoding="utf-8")
    terminal.note(f"results: {chosen.out / 'results.json'}")


def shown(line: dict) -> str:
    """A line for the terminal."""
    what = f"{line['setting']} x{line['factor']:g}" if line["setting"] else "as it is"
    mark = "right" if scoring.right(line["names"], line["answer"]) else "WRONG"
    return (
        f"{what}, {line['judged']}: {said(line['answer'])} {mark} {line['answer'].get('cpu_seconds', 0.0):.0f} s of CPU"
    )


if __name__ == "__main__":
    main()
