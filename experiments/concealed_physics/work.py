"""One case from beginning to end: files made, judged, given to the peers; what came of it in one line."""

import dataclasses
import traceback
from functools import partial
from pathlib import Path

from ..cases import with_files
from .engine import Engine, require
from .generate import generate
from .judge import judge
from .peers import peers
from .plan import Case


def work(case: Case, engine: Engine) -> dict:
    """The line of `case`, answered by `engine`; it has no `answer` where its files could not be made."""
    require(engine)
    line = dataclasses.asdict(case) | {"case": case.name, "fresh": case.fresh, "engine": engine._asdict()}
    return with_files(line, partial(generate, case), partial(_answered, case))


def _answered(case: Case, folder: Path, truth: dict) -> dict:
    if not folder.exists():
        return {"truth": truth, "why": "cannot be of any size in its row"}
    reached = min(truth["reached"], default=0.0)
    sized = min(case.sizes, key=lambda s: abs(s - reached), default=0.0)
    return {"truth": truth, "size": sized, "answer": judge(folder), "peers": _peers(folder, case.body)}


def _peers(folder: Path, body: str) -> dict:
    try:
        return peers(folder, body)
    except Exception:
        return {"error": {"verdict": "none", "physics": [], "where": [], "why": traceback.format_exc()[-600:]}}
