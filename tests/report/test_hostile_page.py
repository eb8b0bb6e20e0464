"""Whatever names of columns, files and vehicles hold, the page shows it as text, and the figures as they stand."""

import dataclasses
import html
import json
import re
import shutil
import subprocess

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from report_examples import VEHICLE, diagnosis

from jaxsub.discrepancy.records.diagnosis import Explained, ParameterEstimate
from jaxsub.findings import Finding
from jaxsub.plain import to_json
from jaxsub.report import write_report
from jaxsub.report.page import render
from jaxsub.report.text import visible

HOSTILE = {
    "script": "<script>document.title='owned'</script>",
    "image": "<img src=x onerror=\"document.title='owned'\">",
    "attribute": "\" onmouseover=\"document.title='owned'\" x='",
    "address": "javascript:document.title='owned'",
    "template": "{{ 7 * 7 }}{% raw %}",
    "comment": "--><!-- ]]> <![CDATA[",
    "end of tags": "</td></table></style></title><svg onload=document.title='owned'>",
    "mathtext": "$\\frac{x$ _1^2 $$",
    "reversed": "run\u202etxt.exe\u2066\u200f",
    "entities": "&lt;b&gt;&amp;&#x41;",
    "long": "depth_of_the_third_sensor_" * 40,
    "unicode": "深さ\u0301\U0001f6a2",
}


def hostile(text):
    """A named diagnosis with every text that comes from a user's files made of `text`."""
    made = diagnosis("named", samples=60)
    renamed = lambda table: {f"{text}{key}": value for key, value in table.items()}
    physics = dataclasses.replace(
        made.physics[0], label=text, effect=text, expression=text, equations=[text, f"sensor:{text}"],
        parameters={text: ParameterEstimate(1.0, 0.1, text)}, trades={text: 0.95},
        rivals=[dataclasses.replace(made.physics[0].rivals[0], label=text, effect=text)],
    )  # fmt: skip
    places = [
        dataclasses.replace(one, where=f"{kind}{text}", times=[(text, 1.0, 2.0)], grows_with=[text])
        for one, kind in zip(made.where, ("", "input:", "sensor:"), strict=True)
    ]
    overlays, traces = [], []
    for one in made.overlays:
        shown = {name: renamed(getattr(one, name)) for name in ("measured", "baseline", "improved")}
        overlays.append(dataclasses.replace(one, run=text, **shown))
    for one in made.forces:
        traces.append(dataclasses.replace(one, run=text, force=renamed(one.force), band=renamed(one.band)))
    follows = lambda one: dataclasses.replace(one, follows=text, inputs={text: np.zeros(121)})
    left = lambda table: {f"{text}{channel}": follows(one) for channel, one in table.items()}
    candidate = dataclasses.replace(made.candidates[0], label=text, outcome=text, amplitudes={text: 1.0})
    return dataclasses.replace(
        made,
        vehicle=text,
        summary=text,
        physics=[physics],
        where=places,
        fit={part: {model: renamed(rms) for model, rms in models.items()} for part, models in made.fit.items()},
        candidates=[candidate],
        forces=traces,
        remaining_forces=[],
        overlays=overlays,
        coefficients=[dataclasses.replace(one, name=text, unit=text, verdict=text) for one in made.coefficients],
        channels=[dataclasses.replace(one, channel=f"{text}{one.channel}", unit=text) for one in made.channels],
        runs=[dataclasses.replace(one, name=text) for one in made.runs],
        notes=[text],
        next_manoeuvre=text,
        kinds={text: 0.5},
        remains={model: left(table) for model, table in made.remains.items()},
        explained=Explained(0.5, {text: 2.0}),
        findings=(Finding(text, "warning", text, text, text, text, ((1, 2),)),),
    )


def tags(page):
    """The elements of a page."""
    return set(re.findall(r"<(\w+)", page))


@pytest.mark.parametrize("kind", HOSTILE)
def test_a_page_of_hostile_names_has_no_element_more(kind):
    """Claim: it has the elements of the same page with plain names, whatever a name spells."""
    vehicle = VEHICLE.replace("horizontal", json.dumps(HOSTILE[kind], ensure_ascii=False)[1:-1])
    assert tags(render(hostile(HOSTILE[kind]), vehicle, {})) <= tags(render(hostile("plain_name"), VEHICLE, {}))


def test_figures_of_hostile_names_are_drawn_into_files_of_plain_names(tmp_path):
    """Claim: mathematical text, unknown letters and control characters in any label stop no figure."""
    name = "".join(HOSTILE[kind] for kind in ("mathtext", "unicode", "reversed", "address"))
    write_report(hostile(name), VEHICLE, tmp_path)
    names = {file.name for file in (tmp_path / "figures").iterdir()}
    drawn = ("residual", "forces", "scan", "before-after", "checks", "coefficients")
    assert names == {f"{name}.png" for name in drawn}


@settings(derandomize=True, deadline=None, max_examples=25)
@given(name=st.text(max_size=30))
def test_any_name_is_text_on_the_page(name):
    """Claim: unescaped, the cell of a run's name is the name, with invisible characters as their code points."""
    page = render(hostile(name), VEHICLE, {})
    (title,) = re.findall(r"<h1>(.*?)</h1>", page, re.DOTALL)
    assert html.unescape(title) == visible(name)
    assert not re.search("[\u202a-\u202e\u2066-\u2069\x00]", page)


def test_what_reverses_the_order_of_letters_is_shown_as_its_code():
    assert visible("run\u202etxt") == "run[U+202E]txt"
    assert visible("10\u202f% of\nit\t°") == "10\u202f% of\nit\t°"
    assert visible(3.5) == 3.5


def test_json_of_a_hostile_diagnosis_reads_back():
    for text in HOSTILE.values():
        content = json.loads(to_json(hostile(text).to_json()))
        assert content["vehicle" if "vehicle" in content else "summary"] == text
        assert content["warnings"][0]["where"] == text and content["left"] == {text: 2.0}


@pytest.mark.skipif(shutil.which("chromium") is None, reason="there is no Chromium")
def test_a_browser_shows_hostile_names_and_runs_nothing(tmp_path):
    """Claim: headless Chromium's text of the page holds every name whole, the title is the vehicle's, nothing ran."""
    text = "\n".join(value for kind, value in HOSTILE.items() if kind != "long")
    made = dataclasses.replace(hostile(text.replace("\n", " ")), notes=list(HOSTILE.values()))
    # a script of the page itself would be stopped: this one tells the text that a reader sees
    probe = "<pre id='seen'></pre><script>document.getElementById('seen').textContent = JSON.stringify(" + (
        "[document.title, document.scripts.length, ...[...document.querySelectorAll('li')].map(e => e.textContent),"
        " document.querySelectorAll('main script, main svg, main [onerror], main [onmouseover]').length])</script>"
    )
    page = re.sub(r"<meta http-equiv.*?>", "", render(made, VEHICLE, {}))  # its policy would stop the probe as well
    (tmp_path / "probed.html").write_text(page.replace("</body>", f"{probe}</body>"), encoding="utf-8")
    command = ["chromium", "--headless", "--no-sandbox", "--disable-gpu", "--virtual-time-budget=2000", "--dump-dom",
               f"--user-data-dir={tmp_path / 'profile'}", (tmp_path / "probed.html").as_uri()]  # fmt: skip
    dom = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True).stdout
    (seen,) = re.findall(r"<pre id=\"seen\">(.*?)</pre>", dom, re.DOTALL)
    title, scripts, *notes, ran = json.loads(html.unescape(seen))
    assert title.startswith("<script>") and title != "owned"
    assert scripts == 1 and ran == 0
    assert notes == [visible(value) for value in HOSTILE.values()]
