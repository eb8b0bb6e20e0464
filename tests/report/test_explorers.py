"""Figures to explore work in a browser, switch, fit the page's size, fetch nothing, and leave still pictures there."""

import dataclasses
import html
import json
import re
import shutil
import subprocess

import numpy as np
import pytest
from report_examples import VEHICLE, bare, diagnosis

from jaxsub.discrepancy.records.diagnosis import Overlay
from jaxsub.discrepancy.records.stored import load_conclusions, save_conclusions
from jaxsub.report.explorers import explorers
from jaxsub.report.exploring import script
from jaxsub.report.page import render

BROWSER = shutil.which("chromium")
# what a reader would find: asked of the page once its figures are there
PROBE = """<pre id="seen"></pre><script>
setTimeout(() => {
  const source = () => Bokeh.documents.map((one) => one.get_model_by_name("series")).find(Boolean).data;
  const before = [source().measured[0], source().time.length];
  const select = document.querySelector("select[name=channel]");
  select.value = [...select.options].find((option) => option.textContent === "u").value;
  select.dispatchEvent(new Event("change"));
  const root = document.documentElement;
  const found = {
    title: document.title, live: document.querySelectorAll(".live > .explorer").length,
    shown: [...document.querySelectorAll("figure.replaced")].filter((one) => one.offsetHeight > 0).length,
    before, after: [source().measured[0], source().time.length], options: select.options.length,
    cut: [...document.querySelectorAll(".scroll")].filter((one) => one.scrollWidth > one.clientWidth + 1).length,
    wider: root.scrollWidth - root.clientWidth,
    tips: Bokeh.documents.map((one) => one.get_model_by_name("values-hover")).find(Boolean).tooltips,
  };
  document.getElementById("seen").textContent = JSON.stringify(found);
  parent.postMessage([innerWidth, found], "*");
}, 3000);
</script></body>"""


def opened(page, folder, width=1400):
    """What the probe finds on the page in headless Chromium, and the lines of its console."""
    (folder / "page.html").write_text(page, encoding="utf-8")
    command = [BROWSER, "--headless", "--no-sandbox", "--disable-gpu", "--virtual-time-budget=9000", "--dump-dom",
               "--hide-scrollbars", "--enable-logging=stderr", f"--window-size={width},2000",
               f"--user-data-dir={folder / 'profile'}", (folder / "page.html").as_uri()]  # fmt: skip
    ran = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    (seen,) = re.findall(r'<pre id="seen">(.*?)</pre>', ran.stdout, re.DOTALL) or ["{}"]
    return (
        ran.stdout,
        json.loads(html.unescape(seen) or "{}"),
        [one for one in ran.stderr.splitlines() if "CONSOLE" in one],
    )


def framed(page, widths):
    """A page with `page` in frames so wide, for a window has at least 500 px; what their probes found is by width."""
    listen = "addEventListener('message', ({ data: [width, found] }) => { seen[width] = found; show(); });"
    show = "const show = () => { document.getElementById('seen').textContent = JSON.stringify(seen); };"
    frame = '<iframe style="border: 0" width="{}" height="2000" srcdoc="{}"></iframe>'
    frames = "".join(frame.format(width, html.escape(page, quote=True)) for width in widths)
    return f'<pre id="seen"></pre><script>const seen = {{}}; {show} {listen}</script>{frames}'


def probed(page):
    """The page with the probe, which its policy would stop."""
    return re.sub(r"<meta http-equiv.*?>", "", page).replace("</body>", PROBE)


@pytest.mark.skipif(BROWSER is None, reason="there is no Chromium")
def test_a_browser_explores_the_page_as_written(page, tmp_path):
    """Claim: under its own policy the page's figures appear, and the console has no error and no refused request."""
    dom, _, console = opened(page("named"), tmp_path)
    assert len(re.findall(r'<section[^>]* class="live"', dom)) == 2
    assert len(re.findall(r'id="plot-\w+"><div class="bk-Column"', dom)) == 2
    wrong = [one for one in console if re.search("error|refused|uncaught|violat", one, re.IGNORECASE)]
    assert wrong == []


@pytest.mark.skipif(BROWSER is None, reason="there is no Chromium")
def test_channels_switch_and_nothing_is_cut_off(page, tmp_path):
    """Claim: another channel has its own samples and its own unit under the pointer; no table is cut off at 1400 px."""
    _, seen, _ = opened(probed(page("named")), tmp_path)
    overlay = diagnosis("named").overlays[0]
    assert seen["live"] == 2 and seen["shown"] == 0
    assert seen["before"][0] != seen["after"][0]
    np.testing.assert_allclose(seen["after"][0], overlay.measured["u"][0], rtol=1e-6)
    assert seen["after"][1] <= len(overlay.times) and seen["options"] == len(overlay.measured)
    assert seen["wider"] <= 0 and seen["cut"] == 0
    assert seen["tips"][0] == ["time", "@time{%.4g} s"] and ["measured", "@measured{%.4g} m/s"] in seen["tips"]


@pytest.mark.skipif(BROWSER is None, reason="there is no Chromium")
def test_a_page_on_a_telephone_is_not_wider_than_that(page, tmp_path):
    """Claim: in 390 and 500 px the figures are there and nothing sticks out."""
    _, seen, _ = opened(framed(probed(page("named")), (390, 500)), tmp_path)
    assert seen.keys() == {"390", "500"}
    assert all(one["live"] == 2 and one["wider"] <= 0 for one in seen.values()), seen


def test_without_script_all_pictures_and_tables_are_there(page):
    """Claim: the page's own text has every still picture, and hides the figures to explore."""
    text = page("named")
    assert text.count("<figure") == 6 and text.count("<img") == 6
    assert text.count('<div class="explorer" hidden>') == 2
    assert explorers(bare()) == {}
    least = render(bare(), VEHICLE, {})
    assert "script-src 'none'" in html.unescape(least) and "<script" not in least


def test_the_page_is_at_most_three_megabytes(report):
    """Claim: so is that of thirty long runs, of which as many can be chosen as there is room for."""
    still = (report("named") / "report.html").stat().st_size
    assert still <= 3_000_000
    made = diagnosis("named", samples=3000)
    many = [dataclasses.replace(made.overlays[0], run=f"run {i}") for i in range(30)]
    forces = [dataclasses.replace(made.forces[0], run=f"run {i}") for i in range(30)]
    of = explorers(dataclasses.replace(made, overlays=many, forces=forces))
    longer = sum(len(one.data) for one in of.values()) - sum(len(one.data) for one in explorers(made).values())
    assert still + longer <= 3_000_000
    assert 5 <= len(of["residuals"].choices[0].options) < 30


def test_a_baseline_that_diverges_on_the_way_is_drawn_as_far_as_it_goes(tmp_path):
    """Claim: beside the spectrum of a model that does not diverge, and stored with numbers beyond single precision."""
    made = diagnosis("named")
    overlay = made.overlays[0]
    gone = np.where(overlay.times > 0.4 * overlay.times[-1], np.inf, 0.0)
    gone[np.flatnonzero(gone)[:9]] = 1e60
    baseline = {channel: values + gone for channel, values in overlay.baseline.items()}
    made = dataclasses.replace(made, overlays=[dataclasses.replace(overlay, baseline=baseline)])
    save_conclusions(made, tmp_path / "diagnosis.npz")
    again = load_conclusions(tmp_path / "diagnosis.npz")
    assert {*explorers(made)} == {*explorers(again)} == {"forces", "residuals"}


def test_no_name_ends_the_data_or_is_a_formula():
    """Claim: a hostile channel is text of the data and of its option: no tag begins there, and no formula."""
    evil = "</script><img src=x onerror=alert(1)> $$\\frac{1}{x}$$"
    times = np.linspace(0.0, 9.0, 90)
    shown = {evil: np.sin(times)}
    made = dataclasses.replace(bare("unknown"), overlays=[Overlay(evil, times, shown, shown, {})])
    found = explorers(made)
    assert "<" not in found["residuals"].data
    assert json.loads(found["residuals"].data)["target_id"] == "plot-residuals"
    page = render(made, VEHICLE, {}, found)
    outside = re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL)
    assert "<img" not in outside and html.escape(evil) in outside
    assert '"name":"PlainText"' in found["residuals"].data.replace(" ", "")


def test_the_script_is_one_that_may_stand_in_a_page():
    assert "</script" not in script() and len(script()) < 1_400_000
