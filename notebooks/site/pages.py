"""Guides, pages of experiments, lessons and gallery as pages of one look."""

import json
import re
import shutil
from pathlib import Path

import jinja2
import markdown2
import nbconvert

from jaxsub.effects import VOCABULARY

from . import mathematics, search
from .reference import Reference
from .search import Page

HERE = Path(__file__).resolve().parent
NOTEBOOKS = HERE.parent
ROOT = NOTEBOOKS.parent
_EXTRAS = ["fenced-code-blocks", "tables", "header-ids", "code-friendly", "cuddled-lists"]
# in the order in which they are read
GUIDES = (
    "index",
    "begin-a-vehicle-file",
    "auv",
    "glider",
    "rov",
    "ship",
    "usv",
    "add-a-vehicle",
    "own-models",
    "describe-your-sensors",
    "logs-and-data",
    "navigate",
    "watch",
    "commands",
    "how-diagnosis-works",
    "which-method",
    "controllers",
    "sweeps",
    "posterior",
    "add-an-effect",
    "add-an-estimator",
    "coming-from",
    "glossary",
)
_LINK = re.compile(r"(?<=\]\()(?![a-z]+:|#)([^)#\s]+)")


def write_pages(out: Path, reference: Reference, chooser: str = "") -> list[str]:
    """Write everything but the reference, with the script of a `chooser` of versions if there is one; what is wrong."""
    found = []
    guides = [NOTEBOOKS / "guide" / f"{name}.md" for name in GUIDES]
    measurements = [ROOT / "experiments" / "README.md", *sorted((ROOT / "experiments").glob("*/README.md"))]
    sources = [*guides, ROOT / "CONTRIBUTING.md", *measurements]
    for path in sources:
        faults = (fault for _, fault in reference.names(source_text(path)) if fault)
        found += [f"{path.relative_to(ROOT)}: {fault}" for fault in faults]
    found += [f"guide/{p.name}: is in no list" for p in (NOTEBOOKS / "guide").glob("*.md") if p.stem not in GUIDES]
    gallery, missing = _gallery(reference)
    lessons = [_lesson(path) for path in sorted(NOTEBOOKS.glob("*.ipynb"))]
    shutil.copytree(NOTEBOOKS / "gallery", out / "gallery", ignore=shutil.ignore_patterns("*.json"))
    for picture in NOTEBOOKS.glob("*.png"):
        shutil.copy(picture, out / picture.name)
    pages = {path: _page(path, reference) for path in sources}
    everything = [*pages.values(), gallery, *lessons]
    template = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined).from_string(
        (HERE / "templates" / "page.html.j2").read_text(encoding="utf-8")
    )
    menu = {
        "Guide": [page for path, page in pages.items() if path not in measurements],
        "Effects": [gallery],
        "Lessons": lessons,
        "Experiments": [pages[path] for path in measurements],
    }
    style = (HERE / "templates" / "site.css").read_text(encoding="utf-8")
    for page in everything:
        made = template.render(page=page, menu=menu, style=style, rooms=_rooms(reference), chooser=chooser)
        (out / page.address).write_text(made, encoding="utf-8")
    (out / "search.js").write_text(search.script(everything, reference.addresses), encoding="utf-8")
    return found + missing


def source_text(path: Path) -> str:
    """A Markdown file with tables of experiments where it has such a line: `{table of NAME: how its header begins}`."""

    def table(match: re.Match[str]) -> str:
        page = (ROOT / "experiments" / match[1] / "README.md").read_text(encoding="utf-8")
        tables = re.findall(r"^\|.*(?:\n\|.*)+", page, re.MULTILINE)
        return next(table for table in tables if table.startswith(f"| {match[2].strip()}"))

    text = path.read_text(encoding="utf-8")
    return re.sub(r"^\{table of (\w+): (.*)\}$", table, text, flags=re.MULTILINE)


def address(path: Path) -> str:
    """Where a file of the repository is in the site: all pages and pictures lie in its root."""
    if path.parent == NOTEBOOKS / "gallery" and path.suffix != ".md":
        return f"gallery/{path.name}"
    if path.suffix != ".md":
        return path.name
    name = path.stem if path.name != "README.md" else "-".join(path.parent.relative_to(ROOT).parts)
    return f"{name.lower()}.html"


def site_links(text: str, path: Path) -> str:
    """Markdown of the file `path` with its links to other files of the repository as links within the site."""
    return _LINK.sub(lambda match: address((path.parent / match[1]).resolve()), text)


def markdown_page(text: str, reference: Reference) -> str:
    """Markdown with formulas and names as HTML."""
    kept, made = mathematics.keep_math(reference.linked(text, ""))
    return mathematics.put_math(str(markdown2.markdown(kept, extras=_EXTRAS)), made)


def _page(path: Path, reference: Reference) -> Page:
    text = source_text(path)
    return Page(address(path), text.partition("\n")[0].lstrip("# "), markdown_page(site_links(text, path), reference))


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
