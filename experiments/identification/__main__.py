"""`python -m experiments.identification --out DIR [--quick]`: the first paper on the shared model, its claims measured.

Writes `results.json` and figures like the paper's 3 to 6. Each part runs in a process of its own, and one that is
already in `DIR/parts` is not run again, so an interrupted run goes on where it stopped.
"""

import argparse
import importlib
import json
import subprocess
import sys
import time
from pathlib import Path

from jaxsub.cli import session

_PARTS = ("scenario_1", "scenario_2", "identifiability", "sweep", "coverage", "filters", "design")


def part(name: str, out: Path, quick: bool) -> dict:
    """One part's results."""
    session.start()
    module = {"scenario_1": "scenarios", "scenario_2": "scenarios", "identifiability": "drift"}.get(name, name)
    run = importlib.import_module(f".{module}", __package__).run
    return run(out, int(name[-1])) if module == "scenarios" else run(out, quick)


def main() -> None:
    """Run the parts that are missing, and put them together."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--quick", action="store_true", help="few starts and experiments: minutes, and wide intervals")
    parser.add_argument("--part", choices=_PARTS, help="this part alone, in this process")
    chosen = parser.parse_args()
    folder = chosen.out / "parts"
    folder.mkdir(parents=True, exist_ok=True)
    if chosen.part:
        begin = time.perf_counter()
        found = part(chosen.part, chosen.out, chosen.quick)
        found["part_seconds"] = time.perf_counter() - begin
        (folder / f"{chosen.part}.json").write_text(json.dumps(found, indent=1), encoding="utf-8")
        return
    for name in _PARTS:
        if (folder / f"{name}.json").exists():
            session.console.print(f"{name}: already in {folder}", highlight=False)
            continue
        session.console.print(f"{name} …", highlight=False)
        command = [sys.executable, "-m", "experiments.identification", "--out", str(chosen.out), "--part", name]
        subprocess.run([*command, *(["--quick"] if chosen.quick else [])], check=True)
    results = {name: json.loads((folder / f"{name}.json").read_text(encoding="utf-8")) for name in _PARTS}
    (chosen.out / "results.json").write_text(json.dumps(results, indent=1), encoding="utf-8")
    session.console.print(f"results: {chosen.out / 'results.json'}", highlight=False)


if __name__ == "__main__":
    main()
