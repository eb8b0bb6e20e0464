"""`python -m notebooks.site --out DIR`: write the site; exit 1, and say why, where it would be faulty.

With `--release NAME` it is written to DIR/NAME, beside other releases, and its pages have a chooser of these.
"""

import argparse
import shutil
import sys
import warnings
from pathlib import Path

from .check import faults
from .pages import write_pages
from .reference import Reference
from .versions import chooser, write_versions


def build(out: Path, chooser: str = "") -> list[str]:
    """Write the site into `out`, which is emptied first; what is wrong with it, a line each.

    Its pages have the script of a `chooser` of versions, if there is one.
    """
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        reference = Reference.of("jaxsub")
        found = [*reference.undocumented(), *reference.write(out / "api"), *write_pages(out, reference, chooser)]
    found += [f"warning: {one.message} ({one.filename}:{one.lineno})" for one in caught if not _told(one)]
    return found + faults(out)


def _told(one: warnings.WarningMessage) -> bool:
    # the packages that read notebooks deprecate each other's names, and pdoc cannot follow annotations that a base
    # class from elsewhere has for checkers of types; nothing of ours is meant
    foreign = "TYPE_CHECKING" in str(one.message) and "annotation for jaxsub" not in str(one.message)
    return foreign or (issubclass(one.category, DeprecationWarning) and "jaxsub" not in one.filename)


def main() -> None:
    """Arguments in, a site out."""
    parser = argparse.ArgumentParser(prog="python -m notebooks.site", description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--release", help="a version, which is kept beside others")
    chosen = parser.parse_args()
    out = chosen.out / chosen.release if chosen.release else chosen.out
    found = build(out, chooser() if chosen.release else "")
    if chosen.release:
        write_versions(chosen.out)
    for line in found:
        print(line, file=sys.stderr)
    print(f"{out / 'index.html'}: {len(list(out.rglob('*.html')))} pages, {len(found)} faults")
    sys.exit(1 if found else 0)


if __name__ == "__main__":
    main()
