"""`python -m experiments.real_recordings NAME --out DIR`: `diagnose` on recordings of real vehicles and rigs."""

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
    """Run one set and write `results.json` beside its diagnosis."""
    parser = argparse.ArgumentParser(prog="python -m experiments.real_recordings", description=__doc__)
    parser.add_argument("name", choices=sorted(SETS))
    parser.add_argument("--out", type=Path, required=True)
    chosen = parser.parse_args()
    session.start()
    results = SETS[chosen.name](chosen.out)
    (chosen.out / "results.json").write_text(json.dumps(results, indent=1), encoding="utf-8")
    print(json.dumps(results, indent=1))


if __name__ == "__main__":
    main()
