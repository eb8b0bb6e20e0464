"""One case from beginning to end: files made, judged, given to the peers; what came of it in one line."""

import dataclasses
import tempfile
import traceback
from pathlib import Path

from jaxsub.cli import session

from .generate import generate
from .judge import judge
from .peers import peers
from .plan import Case


def work(case: Case) -> dict:
    """The line of `case`; it has no `answer` where its files could not be made."""
    session.start()
    line = dataclasses.asdict(case) | {"case": case.name}
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "files"
        try:
            truth = generate(case, folder)
        except Exception:
            # one case that cannot be made must not end the hours of the others; the line says why
            return line | {"why": traceback.format_exc()[-600:]}
        if not folder.exists():
            return line | {"truth": truth, "why": "cannot be of any size in its row"}
        reached = min(truth["reached"], default=0.0)
        sized = min(case.sizes, key=lambda s: abs(s - reached), default=0.0)
        line |= {"truth": truth, "size": sized, "answer": judge(folder)}
        return line | {"peers": _peers(folder, case.body)}


def _peers(folder: Path, body: str) -> dict:
    try:
        return peers(folder, body)
    except Exception:
        return {"error": {"verdict": "none", "physics": [], "where": [], "why": traceback.format_exc()[-600:]}}
