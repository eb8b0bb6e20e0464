"""Cases that are worked on one after the other, and a line for each of them in a file that a later run goes on from."""

import itertools
import json
import multiprocessing
import os
import tempfile
import threading
import traceback
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path
from typing import Any

from jaxsub.cli import session, terminal


def completed(
    cases: Sequence[Any],
    out: Path,
    work: Callable[[Any], dict],
    said: Callable[[dict], str],
    name: Callable[[Any], str],
    **processes: int,
) -> list[dict]:
    """All lines of `out`/cases.jsonl, once `run` has done those of `cases` that have none there by their `name`."""
    out.mkdir(parents=True, exist_ok=True)
    path = out / "cases.jsonl"
    done = {line["case"] for line in read(path)}
    run([case for case in cases if name(case) not in done], path, work, said, **processes)
    return read(path)


def with_files(line: dict, generate: Callable[[Path], dict], answered: Callable[[Path, dict], dict]) -> dict:
    """`line` and what is `answered` of the files and the truth that `generate` makes; `why` where it makes none.

    One case that cannot be made must not end the hours of the others.
    """
    session.start()
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "files"
        try:
            truth = generate(folder)
        except Exception:
            return line | {"why": traceback.format_exc()[-600:]}
        return line | answered(folder, truth)


def run(
    todo: Sequence[Any],
    path: Path,
    work: Callable[[Any], dict],
    said: Callable[[dict], str],
    jobs: int = 1,
    together: int = 1,
) -> None:
    """Append the line that `work` makes of each case of `todo` as soon as it is there; none waits for those beside it.

    Of each, `said` is shown. So many `jobs` run at once, each `together` cases in a process of their own.
    """
    waiting, lock, number = iter(todo), threading.Lock(), itertools.count(1)

    def some() -> list[Any]:
        with lock:
            return list(itertools.islice(waiting, together))

    def tell(line: dict) -> None:
        with lock:
            with path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(line) + "\n")
            message = f"{next(number)}/{len(todo)} {said(line)}"
            terminal.note(message)

    def keep_going(core: int) -> None:
        spawn, own = multiprocessing.get_context("spawn"), (core,) if jobs > 1 else ()
        # a pool for each few cases: one that replaces its processes (max_tasks_per_child) can hang, CPython gh-115634
        while chosen := some():
            with ProcessPoolExecutor(1, mp_context=spawn, initializer=keep_to, initargs=own) as pool:
                for line in pool.map(work, chosen):
                    tell(line)

    with ThreadPoolExecutor(jobs) as threads:
        list(threads.map(keep_going, range(jobs)))


def keep_to(*core: int) -> None:
    """Keep a worker on a core of a number, if given: several that each use all of them wait for one another."""
    for number in core:
        cores = sorted(os.sched_getaffinity(0))
        os.sched_setaffinity(0, {cores[number % len(cores)]})


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
