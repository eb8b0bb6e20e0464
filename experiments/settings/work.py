"""One trial from beginning to end: a case's files, judged with a setting changed."""

import dataclasses
import json
import shutil
import tempfile
from pathlib import Path

from jaxsub.cli import session

from ..concealed_physics.engine import Engine, require
from ..concealed_physics.generate import generate
from ..concealed_physics.judge import judge
from ..concealed_physics.plan import Case
from .trials import Trial, changed


def made(case: Case, files: Path) -> None:
    """The files of a case and its truth, once for all trials of it."""
    if not (files / f"{case.name}.json").exists():
        truth = generate(case, files / case.name)
        (files / f"{case.name}.json").write_text(json.dumps(truth), encoding="utf-8")


def worked(trial: Trial, engine: Engine, files: Path) -> dict:
    """The line of a trial, answered by `engine`."""
    require(engine)
    session.start()
    truth = json.loads((files / f"{trial.case.name}.json").read_text(encoding="utf-8"))
    with tempfile.TemporaryDirectory() as scratch, changed(trial.setting, trial.factor):
        answer = judge(Path(shutil.copytree(files / trial.case.name, Path(scratch) / "files")))
    of = {"judged": trial.case.name, "names": truth["names"], "engine": engine._asdict()}
    return dataclasses.asdict(trial) | {"case": trial.name, **of, "answer": answer}
