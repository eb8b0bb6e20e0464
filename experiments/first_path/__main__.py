"""`python -m experiments.first_path --out DIR [--quick]`: recovery, false alarms and honest `unknown`s, from files.

The generator writes a vehicle file and recordings; the judge is the entry point of `jaxsub diagnose` and sees only
those. `demo`: seeds 0 to 9 of `jaxsub demo`. `clean`: nothing concealed. `outside`: forces that no effect of the
vocabulary has. `again`: `diagnose` on its own `improved.toml`.
"""

import argparse
import json
import tempfile
import time
from pathlib import Path

from scipy import stats

from jaxsub.cli import session
from jaxsub.cli.demo import make_files
from jaxsub.discrepancy import Diagnosis, diagnose
from jaxsub.effects import AbstractEffect
from jaxsub.recording import load
from jaxsub.vehicle import read_vehicle, write_vehicle

from .outside import OUTSIDE


def judge(folder: Path, vehicle: str = "vehicle.toml") -> Diagnosis:
    """The diagnosis of the files in `folder`; writes `improved.toml` there."""
    runs = [load(path) for path in sorted(folder.glob("run*.csv"))]
    diagnosis, improved = diagnose(read_vehicle(folder / vehicle), runs[:-1], runs[-1:])
    write_vehicle(improved, folder / "improved.toml")
    return diagnosis


def case(seed: int, *concealed: AbstractEffect | None, again: bool = False) -> dict:
    """One concealed effect (the demo's choice for `seed` where none is given, None for none), diagnosed from files."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        effect = make_files(folder, seed, *concealed)
        begin = time.perf_counter()
        found = judge(folder)
        line = {
            "seed": seed,
            "concealed": None if effect is None else effect.label,
            "verdict": found.verdict,
            "named": [physics.label for physics in found.physics],
            "rivals": [rival.effect for physics in found.physics for rival in physics.rivals],
            "probability": [physics.probability for physics in found.physics],
            "first_place": found.where[0].where if found.where else None,
            "held_out": found.fit["held_out"],
            "p_value": found.p_value,
            "seconds": time.perf_counter() - begin,
        }
        if effect is not None:
            line["right"] = [physics.effect for physics in found.physics] == [effect.name]
            line["located"] = bool(found.where) and found.where[0].where in effect.where
        if again:
            line["again"] = judge(folder, "improved.toml").verdict
    session.console.print(
        f"{line['concealed']}: {line['verdict']} {line['named']} {line['seconds']:.0f} s", highlight=False
    )
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
    seeds = range(2 if chosen.quick else 10)
    demo = [case(seed, again=seed < 3) for seed in seeds]
    clean = [case(100 + seed, None) for seed in range(2 if chosen.quick else 20)]
    outside = [case(200 + i, effect) for i, effect in enumerate(OUTSIDE[: 1 if chosen.quick else None])]
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
    session.console.print_json(data={k: v for k, v in results.items() if k != "cases"})


if __name__ == "__main__":
    main()
