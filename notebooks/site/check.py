"""What is wrong with a finished site: links and pictures that lead nowhere, formulas that were left as they were."""

import html
import re
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import unquote, urlparse

_LINK = re.compile(r"<(a|img|link|script)\b[^>]*?\b(?:href|src)=\"([^\"]*)\"[^>]*>", re.IGNORECASE)
_ID = re.compile(r"\bid=\"([^\"]+)\"")
_DRAWN = re.compile(r"<(script|style|svg|math)\b[^>]*>.*?</\1>", re.DOTALL)
_CODE = re.compile(r"<(pre|code|script|style|svg|math)\b.*?</\1>", re.DOTALL)


def faults(folder: Path) -> list[str]:
    """A line for each fault of the pages under `folder`."""
    pages = {path: path.read_text(encoding="utf-8") for path in sorted(folder.rglob("*.html"))}
    ids = {path: {html.unescape(name) for name in _ID.findall(page)} for path, page in pages.items()}
    found = []
    for path, page in pages.items():
        found += [f"{path.relative_to(folder)}: {fault}" for fault in _faults(path, page, ids)]
    return found


def _faults(path: Path, page: str, ids: dict[Path, set[str]]) -> Iterator[str]:
    for tag, address in _LINK.findall(_DRAWN.sub("", page)):
        if fault := _leads_nowhere(path, html.unescape(address), ids):
            yield f"{tag} {address}: {fault}"
    for picture in re.findall(r"<img\b[^>]*>", page):
        if "alt=" not in picture:
            yield f"a picture without a word for it: {picture[:60]}"
    if rest := re.search(r"[^$]{0,30}\$[^$]{0,30}", _CODE.sub("", page)):
        yield f"mathematics that was not set: {rest[0].strip()}"


def _leads_nowhere(page: Path, address: str, ids: dict[Path, set[str]]) -> str:
    parts = urlparse(address)
    if parts.scheme in ("http", "https", "data", "mailto"):
        return ""
    target = (page.parent / unquote(parts.path)).resolve() if parts.path else page
    if not target.is_file():
        return "no such file"
    known = ids.get(target)
    if parts.fragment and known is not None and unquote(parts.fragment) not in known:
        return "no such place in it"
    return ""
