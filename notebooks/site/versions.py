"""Released versions of the site beside each other in one folder, with a page that leads to the newest."""

import json
import re
from pathlib import Path

LIST = "versions.js"
_REDIRECT = (
    '<!doctype html><html lang="en"><meta charset="utf-8"><title>jaxsub</title>'
    '<meta http-equiv="refresh" content="0; url={}/index.html"></html>\n'
)


def versions(folder: Path) -> list[str]:
    """The versions whose sites lie in `folder`, the newest first; a name without a number comes last."""
    names = [path.parent.name for path in folder.glob("*/index.html")]
    return sorted(names, key=lambda name: (*map(int, re.findall(r"\d+", name)),), reverse=True)


def write_versions(folder: Path) -> None:
    """Write the list that the pages' choosers read, and the page that leads to the newest version."""
    listed = versions(folder)
    (folder / LIST).write_text(f"const VERSIONS = {json.dumps(listed)};\n", encoding="utf-8")
    (folder / "index.html").write_text(_REDIRECT.format(listed[0]), encoding="utf-8")


def chooser() -> str:
    """The script of a page that lists the versions."""
    return (Path(__file__).parent / "templates" / LIST).read_text(encoding="utf-8")
