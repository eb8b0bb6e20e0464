"""The judge: what `jaxsub diagnose` calls, on the files alone."""

import time
from pathlib import Path

from jaxsub.cli.diagnose import answered
from jaxsub.cli.runs import load_train_and_test
from jaxsub.recording import hold_out
from jaxsub.vehicle import read_vehicle


def judge(folder: Path) -> dict:
    """What `jaxsub diagnose` says of the files in `folder`, the scored part; `error` where it says nothing."""
    runs = sorted(folder.glob("run*.csv"))
    begin, spent = time.perf_counter(), time.process_time()
    try:
        vehicle = read_vehicle(folder / "vehicle.toml")
        train, test = hold_out(load_train_and_test(runs, (), vehicle)[0])
        answer = answered(vehicle, train, test, manoeuvre=False)
        (folder / "out").mkdir()
        answer.write(folder / "out")
    except Exception as failed:  # whatever stops it is an answer too
        return {"error": f"{type(failed).__name__}: {failed}"[-600:]}
    seconds, cpu_seconds = time.perf_counter() - begin, time.process_time() - spent
    found, history = answer.conclusions.to_json(), answer.conclusions.history
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
        "held_out_rms": {"baseline": history[0][1], "improved": history[-1][1]} if history else {},
        "p_value": found["mismatch"]["p_value"],
        "seconds": seconds,
        "cpu_seconds": cpu_seconds,
    }
