"""`python -m experiments.real_recordings NAME … --out DIR`: `diagnose` on recordings of real vehicles and rigs."""

import argparse
import json
from pathlib import Path

from jaxsub.cli import session

from . import emps, rolldecay, seaglider, silverbox, slocum, zigzag

SETS = {
    "seaglider_sg542": seaglider.report,
    "slocum_comet2016": slocum.report,
    "kvlcc2_freerunning": zigzag.report,
    "kvlcc2_rolldecay": rolldecay.report,
    "emps": emps.report,
    "silverbox": silverbox.report,
}


def main() -> None:
    """Run some sets, each in a folder of its name, and write them into `results.json` beside those done before."""
    parser = argparse.ArgumentParser(prog="python -m experiments.real_recordings", description=__doc__)
    parser.add_argument("names", choices=sorted(SETS), nargs="+", metavar="NAME")
    parser.add_argument("--out", type=Path, required=True)
    chosen = parser.parse_args()
    session.start()
    kept = chosen.out / "results.json"
    results = json.loads(kept.read_text(encoding="utf-8")) if kept.is_file() else {}
    for name in chosen.names:
        results[name] = SETS[name](chosen.out / name)
        kept.write_text(json.dumps(results, indent=1), encoding="utf-8")
        print(json.dumps(results[name], indent=1))


if __name__ == "__main__":
    main()
