"""The judge: what `jaxsub diagnose` calls, on the files alone."""

import json
import time
from pathlib import Path

from jaxsub.cli import diagnose


def judge(folder: Path) -> dict:
    """What `jaxsub diagnose` says of the files in `folder`, the scored part; `error` where it says nothing."""
    runs = sorted(folder.glob("run*.csv"))
    begin = time.perf_counter()
    try:
        diagnose.run(folder / "vehicle.toml", runs, (), folder / "out", False, manoeuvre=False)
    except Exception as failed:  # whatever stops it is an answer too
        return {"error": f"{type(failed).__name__}: {failed}"[-600:]}
    seconds = time.perf_counter() - begin
    found = json.loads((folder / "out" / "diagnosis.json").read_text(encoding="utf-8"))
    physics = [
        {
            "effect": entry["effect"],
            "probability": entry["probability"],
            "rivals": [[rival["effect"], rival["probability"]] for rival in entry["rivals"]],
            "parameters": {k: [v["value"], v["standard_error"]] for k, v in entry["parameters"].items()},
        }
        for entry in found["physics"]
    ]
    return {
        "verdict": found["verdict"],
        "physics": physics,
        "kinds": found["mismatch"]["kinds"],
        "coefficients_p_value": found["mismatch"]["coefficients_p_value"],
        "where": [place["equation"] for place in found["mismatch"]["where"]],
        "held_out": found["fit"]["held_out"],
        "p_value": found["mismatch"]["p_value"],
        "seconds": seconds,
    }
