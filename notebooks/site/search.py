"""The index by which a reader searches the site: its sections and the reference's names, without a server."""

import html
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

_HEADING = re.compile(r"<h[1-3][^>]*\bid=\"([^\"]+)\"[^>]*>(.*?)</h[1-3]>", re.DOTALL)
_UNSEEN = re.compile(r"<(script|style|math|svg)\b.*?</\1>|<[^>]+>|&para;|¶", re.DOTALL)
_PLACE = "[/* entries */]"
TEMPLATE = Path(__file__).parent / "templates" / "search.js"


class Page(NamedTuple):
    """A page by its address, its title and its text as HTML."""

    address: str
    title: str
    text: str


def sections(page: Page) -> Iterator[tuple[str, str, str]]:
    """Address, title and plain text of each part of a page that has a heading of its own."""
    parts = _HEADING.split(page.text)
    for anchor, heading, text in zip(parts[1::3], parts[2::3], parts[3::3], strict=True):
        own = _plain(heading)
        title = page.title if own == page.title else f"{page.title}: {own}"
        yield f"{page.address}#{anchor}", title, _plain(text)


def script(pages: Sequence[Page], names: Mapping[str, str]) -> str:
    """The script of the field for searching: an index of `pages` and of the reference's `names` by address."""
    entries = [section for page in pages for section in sections(page)]
    entries += [(address, name, "") for name, address in names.items()]
    return TEMPLATE.read_text(encoding="utf-8").replace(_PLACE, json.dumps(entries, ensure_ascii=False))


def _plain(text: str) -> str:
    return " ".join(html.unescape(_UNSEEN.sub(" ", text)).split())
