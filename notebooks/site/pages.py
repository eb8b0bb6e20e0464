"""Guides, lessons and gallery as pages of one look."""

import json
import re
import shutil
from pathlib import Path
from typing import NamedTuple

import jinja2
import markdown2
import nbconvert

from jaxsub.effects import VOCABULARY

from . import mathematics
from .reference import Reference

HERE = Path(__file__).parent
NOTEBOOKS = HERE.parent
_EXTRAS = ["fenced-code-blocks", "tables", "header-ids", "code-friendly", "cuddled-lists"]
# in the order in which they are read
GUIDES = (
    "index",
    "how-diagnosis-works",
    "which-method",
    "add-a-vehicle",
    "add-an-effect",
    "add-an-estimator",
    "logs-and-data",
    "posterior",
)


class Page(NamedTuple):
    """A page by its address, its title and its text as HTML."""

    address: str
    title: str
    text: str


def write_pages(out: Path, reference: Reference) -> list[str]:
    """Write everything but the reference; what is wrong with it."""
    found = []
    pages = [_guide(name, reference) for name in GUIDES]
    for name in GUIDES:
        text = guide_text(name)
        found += [f"guide/{name}.md: {fault}" for _, fault in reference.names(text) if fault]
    found += [f"guide/{p.name}: is in no list" for p in (NOTEBOOKS / "guide").glob("*.md") if p.stem not in GUIDES]
    gallery, missing = _gallery(reference)
    lessons = [_lesson(path) for path in sorted(NOTEBOOKS.glob("*.ipynb"))]
    shutil.copytree(NOTEBOOKS / "gallery", out / "gallery", ignore=shutil.ignore_patterns("*.json"))
    for picture in NOTEBOOKS.glob("*.png"):
        shutil.copy(picture, out / picture.name)
    everything = [*pages, gallery, *lessons]
    template = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined).from_string(
        (HERE / "templates" / "page.html.j2").read_text(encoding="utf-8")
    )
    menu = {"Guide": pages, "Effects": [gallery], "Lessons": lessons}
    style = (HERE / "templates" / "site.css").read_text(encoding="utf-8")
    for page in everything:
        made = template.render(page=page, menu=menu, style=style, rooms=_rooms(reference))
        (out / page.address).write_text(made, encoding="utf-8")
    return found + missing


def guide_text(name: str) -> str:
    """A guide with the README's tables where it asks for them: `{readme-table: how its header begins}`."""
    readme = (NOTEBOOKS.parent / "README.md").read_text(encoding="utf-8")
    tables = re.findall(r"^\|.*(?:\n\|.*)+", readme, re.MULTILINE)

    def table(match: re.Match[str]) -> str:
        return next(table for table in tables if table.startswith(f"| {match[1].strip()}"))

    text = (NOTEBOOKS / "guide" / f"{name}.md").read_text(encoding="utf-8")
    return re.sub(r"^\{readme-table: (.*)\}$", table, text, flags=re.MULTILINE)


def markdown_page(text: str, reference: Reference) -> str:
    """Markdown with formulas and names as HTML."""
    kept, made = mathematics.keep_math(reference.linked(text, ""))
    return mathematics.put_math(str(markdown2.markdown(kept, extras=_EXTRAS)), made)


def _guide(name: str, reference: Reference) -> Page:
    text = guide_text(name)
    return Page(f"{name}.html", text.partition("\n")[0].lstrip("# "), markdown_page(text, reference))


def _lesson(path: Path) -> Page:
    exporter = nbconvert.HTMLExporter(template_name="basic", exclude_anchor_links=True)
    body, _ = exporter.from_filename(str(path))
    title = re.search(r'"# ([^"\\]+)', path.read_text(encoding="utf-8"))
    return Page(f"{path.stem}.html", title[1] if title else path.stem, mathematics.in_html(body))


def _gallery(reference: Reference) -> tuple[Page, list[str]]:
    """A picture of every effect under its family, and which effects have none."""
    drawn = json.loads((NOTEBOOKS / "gallery" / "results.json").read_text(encoding="utf-8"))["effects"]
    rows = {row["name"]: row for row in drawn}
    lines = [(NOTEBOOKS / "gallery" / "gallery.md").read_text(encoding="utf-8")]
    missing, family = [], ""
    for kind in VOCABULARY:
        row = rows.get(kind.name)
        if row is None or not (NOTEBOOKS / "gallery" / f"{kind.name}.png").is_file():
            missing.append(f"gallery: {kind.name} has no picture; run python -m experiments.gallery")
            continue
        if kind.family != family:
            family = kind.family
            lines.append(f"## {family.capitalize()}")
        about = " ".join((kind.__doc__ or "").split("\n\n")[0].split())
        sizes = ", ".join(f"{n} = {value:.3g} {unit}".strip() for n, (value, unit) in row["numbers"].items())
        picture = f"![{kind.name} in {row['channel']}](gallery/{kind.name}.png)"
        where = f"On {row['vehicle']}, {', '.join(row['where'])}: {sizes}."
        lines += [f"### {kind.name}", about, picture, where, f"`jaxsub.effects.{kind.__name__}`"]
    return Page("gallery.html", "Gallery of effects", markdown_page("\n\n".join(lines), reference)), missing


def _rooms(reference: Reference) -> list[tuple[str, str]]:
    return [(n.removeprefix("jaxsub."), reference.addresses[n]) for n in reference.modules if n.count(".") == 1]
