"""`python -m experiments.tables`: write the tables of measured numbers into the pages of experiments.

A page `experiments/NAME/README.md` beside a committed `results.json` has its tables from `experiments/NAME/tables.py`,
whose function `tables(results)` returns a table by name. Each stands below a line `<!-- table: its name -->`.
"""

import importlib
import json
import re
from collections.abc import Sequence
from pathlib import Path

HERE = Path(__file__).parent
_PLACE = re.compile(r"(<!-- table: (.+?) -->\n)(?:\n(?:\|.*\n)+)?")


def table(header: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """A Markdown table, a line for each row."""
    lines = [header, ["---"] * len(header), *rows]
    return "".join(f"| {' | '.join(map(str, line))} |\n" for line in lines)


def generated(page: Path) -> str:
    """The text of a page with its tables made anew from the `results.json` beside it."""
    results = json.loads((page.parent / "results.json").read_text(encoding="utf-8"))
    made = importlib.import_module(f"experiments.{page.parent.name}.tables").tables(results)
    return _PLACE.sub(lambda place: f"{place[1]}\n{made[place[2]]}", page.read_text(encoding="utf-8"))


def pages() -> list[Path]:
    """The pages that have a committed `results.json` beside them."""
    return sorted(path.with_name("README.md") for path in HERE.glob("*/results.json"))


def main() -> None:
    """Write all pages."""
    for page in pages():
        page.write_text(generated(page), encoding="utf-8")
        print(page)


if __name__ == "__main__":
    main()
