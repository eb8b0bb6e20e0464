"""`python -m experiments.first_path --out DIR [--quick]`: recovery, false alarms and honest `unknown`s, from files.

The generator writes a vehicle file and recordings; the judge is the entry point of `jaxsub diagnose` and sees only
those. `demo`: seeds 0 to 9 of `jaxsub demo`. `clean`: nothing concealed. `outside`: forces that no effect of the
vocabulary has. `again`: `diagnose` on its own `improved.toml`.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from scipy import stats

from jaxsub.cli import session, terminal
from jaxsub.cli.demo import make_files
from jaxsub.effects import AbstractEffect
from jaxsub.plain import to_json

from .outside import OUTSIDE

_JAXSUB = (sys.executable, "-c", "from jaxsub.cli import main; main()")
_CLEAN, _AGAIN = 16, 3


def judge(folder: Path, vehicle: str = "vehicle.toml", out: str = "out") -> dict:
    """The contents of `diagnosis.json` for the files in `folder`, by the command line in a process of its own."""
    runs = sorted(str(path) for path in folder.glob("run*.csv"))
    command = [*_JAXSUB, "diagnose", str(folder / vehicle), *runs, "--out", str(folder / out)]
    subprocess.run(command, check=True, capture_output=True)
    return json.loads((folder / out / "diagnosis.json").read_text(encoding="utf-8"))


def case(seed: int, *concealed: AbstractEffect | None, again: bool = False) -> dict:
    """One concealed effect (the demo's choice for `seed` where none is given, None for none), diagnosed from files."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        effect = make_files(folder, seed, *concealed)
        begin = time.perf_counter()
        found = judge(folder)
        where = [place["equation"] for place in found["mismatch"]["where"]]
        names = [physics["effect"] for physics in found["physics"]]
        line = {
            "seed": seed,
            "concealed": None if effect is None else effect.label,
            "verdict": found["verdict"],
            "named": names,
            "rivals": [rival["effect"] for physics in found["physics"] for rival in physics["rivals"]],
            "probability": [physics["probability"] for physics in found["physics"]],
            "first_place": where[0] if where else None,
            "held_out": found["fit"]["held_out"],
            "p_value": found["mismatch"]["p_value"],
            "seconds": time.perf_counter() - begin,
        }
        if effect is not None:
            line["right"] = found["verdict"] == "named" and names == [effect.name]
            line["located"] = bool(where) and where[0] in effect.where
        if again:
            improved = folder / "out" / "improved.toml"
            line["again"] = judge(folder, str(improved.relative_to(folder)), "again")["verdict"]
    said = f"{line['concealed']}: {line['verdict']} {names} {line['seconds']:.0f} s"
    terminal.say(said)
    return line


def rate(lines: list[dict], count: int) -> dict:
    """A share with its 95 % Clopper-Pearson interval."""
    interval = stats.binomtest(count, len(lines)).proportion_ci(0.95) if lines else None
    return {"count": count, "of": len(lines), "interval": [interval.low, interval.high] if interval else None}


def main() -> None:
    """Run all cases and write `results.json`."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--quick", action="store_true", help="a few of each")
    chosen = parser.parse_args()
    session.start()
    quick = chosen.quick
    with ThreadPoolExecutor(2) as pool:
        demo_cases = [pool.submit(case, seed, again=seed < _AGAIN) for seed in range(2 if quick else 10)]
        clean_cases = [pool.submit(case, 100 + seed, None) for seed in range(2 if quick else _CLEAN)]
        outside_cases = [pool.submit(case, 200 + i, e) for i, e in enumerate(OUTSIDE[: 1 if quick else None])]
        demo, clean, outside = ([c.result() for c in cases] for cases in (demo_cases, clean_cases, outside_cases))
    results = {
        "recovery": rate(demo, sum(line["right"] for line in demo)),
        "located": rate(demo, sum(line["located"] for line in demo)),
        "false_alarm": rate(clean, sum(line["verdict"] != "none" for line in clean)),
        "unknown_recall": rate(outside, sum(line["verdict"] == "unknown" for line in outside)),
        "again_none": rate([x for x in demo if "again" in x], sum(x.get("again") == "none" for x in demo)),
        "cases": {"demo": demo, "clean": clean, "outside": outside},
    }
    chosen.out.mkdir(parents=True, exist_ok=True)
    (chosen.out / "results.json").write_text(json.dumps(results, indent=1), encoding="utf-8")
    terminal.say(to_json({k: v for k, v in results.items() if k != "cases"}))


if __name__ == "__main__":
    main()
