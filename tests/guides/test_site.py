"""The site's build finds what would be wrong with it: dead links, names that are none, formulas that were not set."""

import re
import shutil
import subprocess
import types
from urllib.parse import quote

import pytest

pytest.importorskip("pdoc")
pytest.importorskip("markdown2")
pytest.importorskip("nbconvert")
pytest.importorskip("latex2mathml")

from notebooks.site import check, mathematics, pages, search, versions
from notebooks.site.reference import Reference


def test_faults_of_pages_are_found(tmp_path):
    (tmp_path / "good.html").write_text('<h1 id="top">x</h1><a href="bad.html#here">y</a><code>$HOME</code>')
    (tmp_path / "bad.html").write_text(
        '<p id="here">costs $x_1$</p><a href="none.html">a</a><a href="good.html#bottom">b</a><img src="no.png">'
        '<a href="https://example.org/x">c</a>'
    )
    found = check.faults(tmp_path)
    assert [line.partition(": ")[0] for line in found] == ["bad.html"] * 5
    for words in ("none.html: no such file", "#bottom: no such place", "no.png", "without a word", "not set"):
        assert any(words in line for line in found), words


PAGES = [
    search.Page(
        "fins.html", "Fins", '<h1 id="fins">Fins</h1><p>All.</p><h2 id="play">Play &amp; wear</h2><p>backlash</p>'
    ),
    search.Page("filters.html", "Filters", '<h1 id="filters">Filters</h1><p>An <b>innovation</b> of a fin.</p>'),
]


def test_sections_are_found_by_heading_and_text():
    listed = [section for page in PAGES for section in search.sections(page)]
    assert listed == [
        ("fins.html#fins", "Fins", "All."),
        ("fins.html#play", "Fins: Play & wear", "backlash"),
        ("filters.html#filters", "Filters", "An innovation of a fin."),
    ]


@pytest.mark.skipif(shutil.which("chromium") is None, reason="there is no Chromium")
@pytest.mark.parametrize(
    ("words", "expected"),
    [("fin", ["fins.html#fins", "fins.html#play", "filters.html#filters"]), ("wear BACKLASH", ["fins.html#play"]),
     ("fuzzynoise", ["api/f.html#FuzzyNoise"]), ("nothing", [])],
)  # fmt: skip
def test_a_browser_lists_what_has_every_word_titles_first(tmp_path, words, expected):
    """Claim: without a server, from a file; names of the reference too."""
    (tmp_path / "search.js").write_text(search.script(PAGES, {"jaxsub.f.FuzzyNoise": "api/f.html#FuzzyNoise"}))
    page = '<input id="search"><ul id="found" hidden></ul><script src="search.js"></script>'
    (tmp_path / "index.html").write_text(page)
    address = f"file://{tmp_path}/index.html?q={quote(words)}"
    command = ["chromium", "--headless", "--no-sandbox", "--disable-gpu", "--dump-dom", address]
    shown = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert re.findall(r'<li><a href="([^"]+)"', shown) == expected
    assert ("Nothing was found." in shown.partition("<script")[0]) is not bool(expected)


@pytest.mark.skipif(shutil.which("chromium") is None, reason="there is no Chromium")
def test_a_browser_lists_the_versions_beside_a_page_the_newest_first(tmp_path):
    """Claim: from a file, with the page's own version chosen; the folder's first page leads to the newest."""
    for name in ("0.9.0", "0.10.0"):
        (tmp_path / name).mkdir()
        script = f'<script src="../{versions.LIST}"></script><script>{versions.chooser()}</script>'
        (tmp_path / name / "index.html").write_text(f'<select id="version" hidden></select>{script}')
    versions.write_versions(tmp_path)
    assert "url=0.10.0/index.html" in (tmp_path / "index.html").read_text()
    address = f"file://{tmp_path}/0.9.0/index.html"
    command = ["chromium", "--headless", "--no-sandbox", "--disable-gpu", "--dump-dom", address]
    shown = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert re.findall(r'<option value="([^"]+)"( selected="")?', shown) == [("0.10.0", ""), ("0.9.0", ' selected=""')]
    assert "hidden" not in re.findall(r"<select[^>]*>", shown)[0]


def test_formulas_become_mathml_and_code_is_left():
    page = mathematics.in_html("<p>with $a_1 &lt; b_2$ and $$\\frac{1}{2}$$</p><pre>$a$</pre><code>$b$</code>")
    assert page.count("<math") == 2 and "<mfrac>" in page and "<pre>$a$</pre><code>$b$</code>" in page
    text = pages.markdown_page("so $x_1 * y_1 * z$ and `$HOME`", Reference({}, {}))
    assert "<em>" not in text and text.count("<math") == 1 and "$HOME" in text


def test_names_are_linked_where_they_are_described_and_faults_where_they_are_nothing():
    import pdoc.doc

    addresses = {"jaxsub.units.to_si": "api/jaxsub/units.html#to_si"}
    reference = Reference({"jaxsub.units": pdoc.doc.Module.from_name("jaxsub.units")}, addresses)
    text = "`jaxsub.units.to_si` beside `jaxsub.units.TIME`, `jaxsub.units.nothing` and `jaxsub.errors.InputError`"
    assert reference.linked(text, "").startswith("[`jaxsub.units.to_si`](api/jaxsub/units.html#to_si)")
    faults = ["`jaxsub.units.nothing` is nothing", "`jaxsub.errors` has no page"]
    assert [fault for _, fault in reference.names(text)] == ["", "", *faults]


def test_missing_docstrings_are_faults():
    import pdoc.doc

    bare = types.ModuleType("jaxsub.bare")
    exec("def spoken():\n    'Says.'\n\n\ndef silent():\n    pass\n", bare.__dict__)
    bare.__all__ = ["spoken", "silent"]
    for name in bare.__all__:
        bare.__dict__[name].__module__ = "jaxsub.bare"
    found = Reference({"jaxsub.bare": pdoc.doc.Module(bare)}, {}).undocumented()
    assert found == ["jaxsub.bare: has no docstring", "jaxsub.bare.silent: has no docstring"]


def test_tables_of_experiments_stand_in_the_guide():
    guides = {name: pages.source_text(pages.NOTEBOOKS / "guide" / f"{name}.md") for name in pages.GUIDES}
    assert "| Gauss–Newton (Levenberg–Marquardt) |" in guides["which-method"]
    assert all("{table" not in text for text in guides.values())


def test_links_between_files_are_links_between_pages():
    guide = pages.NOTEBOOKS / "guide" / "index.md"
    text = (
        "[a](sweeps.md#clusters) [b](../../experiments/emps/README.md) ![c](../report.png) [d](https://example.org/x)"
    )
    assert pages.site_links(text, guide) == (
        "[a](sweeps.html#clusters) [b](experiments-emps.html) ![c](report.png) [d](https://example.org/x)"
    )
