"""`python -m experiments.concealed_physics --out DIR [--quick] [--part CONDITION] [--count N] [--skip N] [--jobs N]`.

Every case is a set of files that conceal physics, and the answer of `jaxsub diagnose`, which sees only them.
`DIR/cases.jsonl` holds a line for each case that is done; an interrupted run goes on where it stopped, and
`results.json` and the figures are drawn from all of its lines. Cases are ordered so that at any time every condition
has been done in proportion. `--skip` leaves out the first of that order: what the engine was mended on proves less.
"""

import argparse
import itertools
import json
import multiprocessing
import threading
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path

from jaxsub.cli import terminal

from .assemble import assemble, is_right
from .figures import draw
from .plan import COUNTS, Case, ordered
from .work import keep_to, work

# a process may hold so many compiled programs and no more
_CASES_A_PROCESS = 6


def main() -> None:
    """Do the cases that are missing, and assemble what all lines say."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--quick", action="store_true", help="about a dozen cases")
    parser.add_argument("--part", choices=list(COUNTS), help="this condition alone")
    parser.add_argument("--count", type=int, help="so many cases of each condition")
    parser.add_argument("--skip", type=int, default=0, help="leave out so many cases, the first of the order")
    parser.add_argument("--jobs", type=int, default=1, help="cases at once")
    chosen = parser.parse_args()
    counts = {c: chosen.count or counts[chosen.quick] for c, counts in COUNTS.items() if chosen.part in (None, c)}
    chosen.out.mkdir(parents=True, exist_ok=True)
    path = chosen.out / "cases.jsonl"
    done = {line["case"] for line in read(path)}
    todo = [case for case in ordered(counts)[chosen.skip :] if case.name not in done]
    run(todo, path, chosen.jobs)
    results = assemble(read(path))
    (chosen.out / "results.json").write_text(json.dumps(results, indent=1), encoding="utf-8")
    draw(results, chosen.out / "figures")
    terminal.note(f"results: {chosen.out / 'results.json'}")


def run(todo: list[Case], path: Path, jobs: int) -> None:
    """Append a line for each case of `todo` as soon as it is there; none waits for those beside it."""
    waiting, lock, number = iter(todo), threading.Lock(), itertools.count(1)

    def some() -> list[Case]:
        with lock:
            return list(itertools.islice(waiting, _CASES_A_PROCESS))

    def tell(line: dict) -> None:
        with lock:
            with path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(line) + "\n")
            told = f"{next(number)}/{len(todo)} {said(line)}"
            terminal.note(told)

    def keep_going(core: int) -> None:
        spawn, own = multiprocessing.get_context("spawn"), (core,) if jobs > 1 else ()
        # a pool for each few cases: one that replaces its processes (max_tasks_per_child) can hang, CPython gh-115634
        while chosen := some():
            with ProcessPoolExecutor(1, mp_context=spawn, initializer=keep_to, initargs=own) as pool:
                for line in pool.map(work, chosen):
                    tell(line)

    with ThreadPoolExecutor(jobs) as threads:
        list(threads.map(keep_going, range(jobs)))


def said(line: dict) -> str:
    """A line for the terminal."""
    if "answer" not in line:
        return f"{line['case']}: {', '.join(line['concealed'])} {line['why'][-80:]}"
    answer = line["answer"]
    names = [entry["effect"] for entry in answer.get("physics", [])]
    mark = "right" if is_right(line, answer) else "WRONG"
    size = f"{line['size']:g} σ" if line["concealed"] else "nothing"
    spent = f"{answer.get('seconds', 0.0):.0f} s"
    verdict = answer.get("verdict", "error")
    return f"{line['case']}: {', '.join(line['concealed'])} {size}: {verdict} {names} {mark} {spent}"


def read(path: Path) -> list[dict]:
    """The lines so far; one cut short by an interruption is not counted."""
    if not path.exists():
        return []
    lines = []
    for text in path.read_text(encoding="utf-8").splitlines():
        try:
            lines.append(json.loads(text))
        except json.JSONDecodeError:
            continue
    return lines


if __name__ == "__main__":
    main()
