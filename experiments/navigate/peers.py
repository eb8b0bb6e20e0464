"""The filters beside ours on BROAD: installed ones, and errors that the data set's authors published."""

import json
from pathlib import Path

import numpy as np

from ..data import data_folder
from ..fuzzy_filter.broad import peer_scores, prepared, trials


def run(out: Path, quick: bool) -> dict:
    """Errors in degrees by trial and method; `quick` takes one trial and leaves out the filters of `ahrs`."""
    published = json.loads((data_folder("broad") / "trials_and_published_rmse.json").read_text(encoding="utf-8"))
    found = {}
    for trial in trials()[: 1 if quick else None]:
        start = prepared(trial, len(trial.times))
        found[trial.name] = peer_scores(trial, float(np.arctan2(start.down, start.horizontal)), quick)
        found[trial.name] |= {f"published_{of}": published[trial.name][of] for of in ("madgwick", "mahony")}
    return {"trials": found}
