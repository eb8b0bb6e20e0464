"""The page stands alone, escapes what it quotes, shows what the diagnosis holds, and shrinks with the verdict."""

import dataclasses
import html
import re
from html.parser import HTMLParser
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest
from report_examples import VEHICLE, bare, diagnosis
from report_traces import CHANNELS, COEFFICIENTS

from jaxsub.discrepancy.records.diagnosis import Rival
from jaxsub.discrepancy.records.stored import load_conclusions, save_conclusions
from jaxsub.estimate import RunValues
from jaxsub.report import draw
from jaxsub.report.page import TITLE, render
from jaxsub.report.text import plain_label

VERDICTS = ("none", "named", "ambiguous", "unknown")
VOID = {"meta", "img", "source", "br", "link", "input"}


class Outline(HTMLParser):
    """Collects addresses, headings and text, and checks that every element is closed."""

    def __init__(self, page):
        super().__init__()
        self.addresses, self.text, self.open, self.ids, self.tags = [], "", [], [], []
        self.feed(page)
        assert not self.open

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        values = dict(attributes)
        self.addresses += [values[key] for key in ("src", "srcset", "href") if key in values]
        self.ids += [values["id"]] if "id" in values else []
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] not in ("style", "script"):
            self.text += data


@pytest.mark.parametrize("verdict", VERDICTS)
def test_page_needs_nothing_else(page, verdict):
    text = page(verdict)
    outline = Outline(text)
    images = [address for address in outline.addresses if not address.startswith("#")]
    assert len(images) >= 3
    assert all(address.startswith("data:image/png;base64,") for address in images)
    assert not {"link", "iframe"} & set(outline.tags)
    text = re.sub(r"<script.*?</script>", "", text, flags=re.DOTALL)  # addresses in Bokeh's are names, and comments
    assert "http://" not in text and "https://" not in text and "@import" not in text and "url(" not in text
    assert {address[1:] for address in outline.addresses if address.startswith("#")} <= set(outline.ids)


def test_everything_accepted_or_measured_appears(page):
    text = Outline(page("named")).text
    made = diagnosis("named")
    found = made.physics[0]
    wanted = [made.vehicle, made.summary, found.label, *(rival.label for rival in found.rivals), *made.notes]
    wanted += [plain_label(candidate.label) for candidate in made.candidates] + [
        candidate.outcome for candidate in made.candidates
    ]
    wanted += (
        [name for name, *_ in COEFFICIENTS]
        + [run.name for run in made.runs]
        + ["0.614 ± 0.021", "15.4 → 1.10", "0.15 → 0.011 m/s"]
    )
    assert [thing for thing in wanted if thing not in text] == []
    rows = {"phi": "φ", "theta": "θ", "psi": "ψ"}
    assert all(f"<th>{rows.get(name, name)}</th>" in page("named") for name in CHANNELS)
    assert text.count("⚠") == 2  # p's noise is twice what was stated, and the line that says so


@pytest.mark.parametrize(
    ("verdict", "badge", "sections"),
    [
        ("none", "no mismatch", {"where", "what", "gain"}),
        ("named", "physics named", {"where", "what", "term", "gain"}),
        ("ambiguous", "ambiguous", {"where", "what", "term", "gain"}),
        ("unknown", "unknown physics", {"where", "what", "gain"}),
    ],
)
def test_verdict_chooses_sections(page, verdict, badge, sections):
    text = page(verdict)
    outline = Outline(text)
    assert f'<span class="badge {verdict}">{badge}</span>' in text
    drawn = {one for one in outline.ids if one.startswith("plot-")}
    assert set(outline.ids) - drawn == sections | {"coefficients", "data", "recordings", "notes", "cite"}
    accepted = "term" in sections
    assert (">improved</th>" in text) == accepted
    assert ("[[effects]]" in outline.text) == accepted
    assert ("Nothing in the vocabulary explains" in outline.text) == (verdict == "unknown")
    assert ("cannot tell the candidates apart" in outline.text) == (verdict == "ambiguous")
    assert ("Next manoeuvre." in outline.text) == (verdict == "ambiguous")
    assert ("Nowhere significantly" in outline.text) == (verdict == "none")


def test_surrogate_terms_of_an_unknown_mismatch_are_shown_to_help():
    """Claim: an unknown mismatch that is described has the improved model's terms, errors and coefficients."""
    text = Outline(render(diagnosis("unknown", described=True), VEHICLE, {})).text
    assert "Nothing in the vocabulary explains" in text and "claim no cause" in text
    assert "[[effects]]" in text and "15.4 → 1.10" in text and "Before and after" in text
    assert "claim no cause" not in Outline(render(diagnosis("unknown"), VEHICLE, {})).text


def test_the_regime_and_what_an_effect_trades_with_are_said():
    """Claim: a mismatch has the regime it stands out in, and an effect the coefficient that it is correlated with."""
    text = Outline(render(diagnosis("named"), VEHICLE, {})).text.replace("\u202f", " ")
    assert "|r| ≥ 0.12 rad/s81 % of it, 6 % of the rest" in text
    assert "correlated withYv, correlation −0.97" in text


def test_the_kind_of_mismatch_is_said():
    """Claim: every kind has its probability; nothing is said where nothing was asked."""
    text = Outline(render(diagnosis("named"), VEHICLE, {})).text.replace("\u202f", " ")
    assert "the vehicle’s structure97 %" in text and "a sensor< 0.1 %" in text
    assert "by the accepted effects and their rivals" in text
    assert "before anything is named" in render(diagnosis("unknown"), VEHICLE, {})
    assert "What kind" not in render(bare(), VEHICLE, {})


def test_what_differs_by_run_has_a_table_and_a_picture(tmp_path):
    """Claim: each training run's own value stands with its error beside the run, in the page, the file, as stored."""
    drift = RunValues("buoyancy", "N", 0.085, True, 0.03, np.array([510.1, 509.6]), np.array([0.02, 0.0123]))
    made = dataclasses.replace(diagnosis("named"), by_run=[drift])
    save_conclusions(made, tmp_path / "diagnosis.npz")
    for one in (made, load_conclusions(tmp_path / "diagnosis.npz")):
        pictures = draw(one)
        assert "by-run" in pictures and "by-run" not in draw(diagnosis("none"))
        text = render(one, VEHICLE, pictures)
        outline = Outline(text)
        assert "by-run" in outline.ids
        assert re.search(r"zigzag-2</th><td class=\"n\">509.600 ± 0.012", text)
    (told,) = made.to_json()["by_run"].values()
    assert told["spread"] == {"value": 0.085, "standard_error": 0.03, "estimated": True}
    assert [run["run"] for run in told["runs"]] == ["turns-1", "zigzag-2"]
    assert [run["value"] for run in told["runs"]] == [510.1, 509.6]


def test_a_noise_that_nobody_stated_is_no_wrong_one():
    """Claim: where σ is what the baseline leaves, noise far below it in the recording is no warning."""
    made = diagnosis("named")
    channels = [dataclasses.replace(one, sigma_estimated=True, record_sigma=0.04 * one.sigma) for one in made.channels]
    made = dataclasses.replace(made, channels=channels, notes=[])
    assert "⚠" not in render(made, VEHICLE, {})


def test_what_is_not_random_or_goes_with_an_input_is_flagged():
    """Claim: of what remains each test below chance is marked, with the input's name; and the gain is weighed."""
    made = diagnosis("named")
    text = render(made, VEHICLE, {})
    remains = [left for models in made.remains.values() for left in models.values()]
    assert text.count("(rudder)") == sum(left.independent < 1e-3 for left in remains) > 0
    table = text[text.index("What remains there") :].split("</table>")[0]
    assert table.count(" flag") == sum((left.independent < 1e-3) + (left.random < 1e-3) for left in remains)
    assert "12\u202f% of the squared simulation error is left" in Outline(text).text.replace("\xa0", "\u202f")


def test_what_checks_found_is_a_section_of_its_own():
    """Claim: every finding is there with its place and remedy, the gravest first; without one there is no section."""
    made = diagnosis("named")
    text = Outline(render(dataclasses.replace(made, findings=made.findings[::-1]), VEHICLE, {})).text
    shown = text[text.index("Checks of the recordings") :]
    assert shown.index("masked as a sentinel") < shown.index("read as the units")
    assert "runs/zigzag-2.csv, rows 120 to 219, column 'z'" in shown and "check the logger" in shown
    assert "Checks of the recordings" not in render(dataclasses.replace(made, findings=()), VEHICLE, {})


@pytest.mark.parametrize("verdict", VERDICTS)
def test_tables_are_never_empty(page, verdict):
    assert not re.search(r"<tbody>\s*</tbody>", page(verdict))


def test_quoted_text_is_escaped():
    evil = "<script>alert('x')</script>&"
    made = diagnosis("named")
    found = dataclasses.replace(
        made.physics[0], label=evil, expression=evil, equations=[evil], rivals=[Rival(evil, evil, 0.1)]
    )
    places = [dataclasses.replace(made.where[0], where=f"input:{evil}", times=[(evil, 0.0, 1.0)], grows_with=[evil])]
    made = dataclasses.replace(
        made, vehicle=evil, summary=evil, physics=[found], where=places, notes=[evil], next_manoeuvre=evil
    )
    text = render(made, VEHICLE.replace("horizontal", evil), {})
    assert "<script" not in text and "alert(&#39;x&#39;)" in text
    Outline(text)


@pytest.mark.parametrize("verdict", VERDICTS)
def test_least_diagnosis_renders(verdict):
    outline = Outline(render(bare(verdict), "schema = 1\n", {}))
    assert {"table", "img"}.isdisjoint(outline.tags) and outline.tags.count("pre") == 1  # how to cite


def test_the_first_numbers_are_the_error_removed_the_effect_and_the_channel_in_its_unit(page):
    """Claim: the header has them in this order with their units, and no p-value."""
    text = Outline(page("named")).text.replace("\u202f", " ")
    header = text[: text.index("Where model and recordings differ")]
    # a label comes before its value
    wanted = ["of the test error is removed", "97 %", "Cd of crossflow-drag[horizontal]", "0.614 ± 0.021"]
    places = [header.rindex(one) for one in (*wanted, "rms error of v, test runs", "0.15 → 0.011 m/s")]
    assert places == sorted(places)
    assert "up to 900 N in sway" in header and "10⁻" not in header and "p =" not in header


def test_a_mismatch_in_a_sensor_shows_its_residual_first():
    """Claim: with most of the mismatch in a sensor the first figure is its residual; forces come later."""
    made = diagnosis("named")
    assert "residual" not in draw(made)
    sensor = dataclasses.replace(made, where=[dataclasses.replace(made.where[2], share=0.9), made.where[0]])
    pictures = draw(sensor)
    text = render(sensor, VEHICLE, pictures)
    first, *_ = re.findall(r'<img alt="([^"]*)"', text)
    assert first.startswith("Residual of psi")
    assert text.index("The same mismatch as forces") > text.index("Residual of ψ on a test run")


def test_one_quantity_has_one_symbol(page):
    """Claim: outside of code the page has no Greek letter's name, and the drawn labels have none."""
    apart = r"<(style|script).*?</\1>|<pre.*?</pre>|<code>.*?</code>|<[^>]*>"
    text = re.sub(apart, " ", page("named"), flags=re.DOTALL)
    assert not re.search(r"\b(phi|theta|psi|delta)(_\w+)?\b", text)


def test_the_page_is_cited_as_the_project_says():
    """Claim: the title is that of CITATION.cff, with the version that made the page."""
    citation = (Path(__file__).parents[2] / "CITATION.cff").read_text(encoding="utf-8")
    assert f'title: "{TITLE}"' in citation
    text = html.unescape(render(bare(), VEHICLE, {}))
    assert TITLE in text and f"version = {{{version('jaxsub')}}}" in text
