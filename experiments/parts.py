"""An experiment of several parts: each runs in a process of its own, and one that is done is not run again.

So an interrupted run goes on where it stopped. `DIR/parts` holds what each part found, `DIR/results.json` all of them.
"""

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from jaxsub.cli import session, terminal

Part = Callable[[str, Path, bool], dict]


def main(
    package: str,
    about: str | None,
    names: Sequence[str],
    part: Part,
    assembled: Callable[[Mapping[str, dict]], dict] = dict,
) -> None:
    """Run those of the parts `names` that are missing and write their results, as `assembled` puts them together."""
    parser = argparse.ArgumentParser(prog=f"python -m {package}", description=about)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--quick", action="store_true", help="few seeds and starts: minutes, and wide intervals")
    parser.add_argument("--part", choices=names, help="this part alone, in this process")
    chosen = parser.parse_args()
    folder = chosen.out / "parts"
    folder.mkdir(parents=True, exist_ok=True)
    if chosen.part:
        session.start(long=True)
        begin = time.perf_counter()
        found = part(chosen.part, chosen.out, chosen.quick)
        found["part_seconds"] = time.perf_counter() - begin
        (folder / f"{chosen.part}.json").write_text(json.dumps(found, indent=1), encoding="utf-8")
        return
    for name in names:
        if (folder / f"{name}.json").exists():
            terminal.note(f"{name}: already in {folder}")
            continue
        terminal.note(f"{name} …")
        command = [sys.executable, "-m", package, "--out", str(chosen.out), "--part", name]
        subprocess.run([*command, *(["--quick"] if chosen.quick else [])], check=True)
    written = {name: folder / f"{name}.json" for name in names}
    # a part whose recordings are not here says so and ends without a result
    found = {name: json.loads(path.read_text(encoding="utf-8")) for name, path in written.items() if path.exists()}
    (chosen.out / "results.json").write_text(json.dumps(assembled(found), indent=1), encoding="utf-8")
    terminal.say(f"results: {chosen.out / 'results.json'}")
