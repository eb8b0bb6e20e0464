"""The site's build finds what would be wrong with it: dead links, names that are none, formulas that were not set."""

import types

import pytest

pytest.importorskip("pdoc")
pytest.importorskip("markdown2")
pytest.importorskip("nbconvert")
pytest.importorskip("latex2mathml")

from notebooks.site import check, mathematics, pages
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


def test_formulas_become_mathml_and_code_is_left():
    page = mathematics.in_html("<p>with $a_1 &lt; b_2$ and $$\\frac{1}{2}$$</p><pre>$a$</pre><code>$b$</code>")
    assert page.count("<math") == 2 and "<mfrac>" in page and "<pre>$a$</pre><code>$b$</code>" in page
    text = pages.markdown_page("so $x_1 * y_1 * z$ and `$HOME`", Reference({}, {}))
    assert "<em>" not in text and text.count("<math") == 1 and "$HOME" in text


def test_names_are_linked_where_they_are_described_and_faults_where_they_are_nothing():
    reference = Reference({}, {"jaxsub.units.to_si": "api/jaxsub/units.html#to_si"})
    text = "`jaxsub.units.to_si` beside `jaxsub.units.TIME` and `jaxsub.units.nothing`"
    assert reference.linked(text, "").startswith("[`jaxsub.units.to_si`](api/jaxsub/units.html#to_si)")
    assert [fault for _, fault in reference.names(text)] == ["", "", "`jaxsub.units.nothing` is nothing"]


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
