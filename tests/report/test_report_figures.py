"""Figures are PNG files that show what matters: peaks survive thinning, and awkward names and data break nothing."""

import dataclasses
import io
import warnings

import matplotlib
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from IPython.core.formatters import DisplayFormatter
from PIL import Image
from report_examples import diagnosis
from report_traces import CHANNELS

from jaxsub.discrepancy.records.diagnosis import ForceTrace
from jaxsub.report import figures
from jaxsub.report.bars import draw_scan, moved_coefficients
from jaxsub.report.drawing import LONGEST, drawable, style, thin
from jaxsub.report.figures import draw
from jaxsub.report.forces import draw_forces, telling_trace
from jaxsub.report.overlay import affected_channels

FIGURES = {
    "none": {"forces", "scan", "before-after", "checks"},
    "named": {"forces", "by-state", "scan", "before-after", "checks", "coefficients"},
    "ambiguous": {"forces", "by-state", "scan", "before-after", "checks", "coefficients"},
    "unknown": {"forces", "by-state", "scan", "before-after", "checks"},
}


@pytest.mark.parametrize(
    "verdict", [pytest.param(v, marks=[pytest.mark.long] if v in ("none", "unknown") else []) for v in FIGURES]
)
def test_figures_are_png_files(report, verdict):
    files = list((report(verdict) / "figures").iterdir())
    assert {file.name for file in files} == {f"{name}.png" for name in FIGURES[verdict]}
    for file in files:
        with Image.open(file) as image:
            assert image.format == "PNG"
            assert min(image.size) > 200
            colors = image.convert("RGB").getcolors(maxcolors=1 << 24)
            assert len(colors) > 10  # not blank


@settings(derandomize=True, deadline=None, max_examples=100)
@given(
    values=arrays(float, st.integers(0, 400), elements=st.floats(-1e9, 1e9) | st.just(np.nan)),
    longest=st.integers(2, 100),
)
def test_thinning_keeps_extremes_order_and_samples(values, longest):
    times = np.arange(values.size) * 0.1
    kept_times, kept = thin(times, values, longest)
    finite = values[np.isfinite(values)]
    assert kept.size == finite.size if finite.size <= longest else kept.size <= longest
    if finite.size:
        assert kept.min() == finite.min() and kept.max() == finite.max()
    assert np.all(np.diff(kept_times) > 0)
    np.testing.assert_array_equal(kept, values[np.searchsorted(times, kept_times)])


def test_long_trace_is_thinned_and_keeps_its_spike():
    values = np.sin(np.linspace(0.0, 50.0, 200_000))
    values[123_456] = 7.0
    _, kept = thin(np.arange(values.size), values)
    assert kept.size <= LONGEST
    assert kept.max() == 7.0


def test_force_figure_is_of_the_run_with_the_largest_located_force():
    assert telling_trace(diagnosis("named")).run == "turns-1"
    assert telling_trace(dataclasses.replace(diagnosis("named"), forces=[])) is None


def test_overlay_shows_the_channels_that_gained_most():
    made = diagnosis("named")
    assert affected_channels(made, made.overlays[0]) == ["v", "r", "psi", "phi"]
    assert set(affected_channels(diagnosis("none"), made.overlays[0])) < set(CHANNELS)


def test_only_comparable_coefficients_are_compared():
    made = diagnosis("named")
    rows = moved_coefficients(made)
    assert "K_delta_er" not in [row[0].name for row in rows]  # its standard error is infinite
    changes = [abs(change) for _, change, _ in rows]
    assert changes == sorted(changes, reverse=True)
    first = rows[0][0]
    assert rows[0][1] == (first.improved.value - first.baseline.value) / first.baseline.standard_error


def test_settings_of_the_caller_stay():
    before = dict(matplotlib.rcParams)
    with style():
        assert matplotlib.rcParams["text.parse_math"] is False
    assert dict(matplotlib.rcParams) == before


@pytest.fixture
def only_the_scan(monkeypatch):
    monkeypatch.setattr(figures, "_FIGURES", (draw_scan,))


def test_a_grid_that_the_caller_likes_is_not_drawn_into_ours(only_the_scan):
    plain = draw(diagnosis("named"))["scan"].png
    with matplotlib.rc_context({"axes.grid": True}):
        assert draw(diagnosis("named"))["scan"].png == plain


def test_a_notebook_shows_a_figure_and_prints_no_bytes_of_it(only_the_scan):
    formatted, _ = DisplayFormatter().format(draw(diagnosis("named"))["scan"])
    with Image.open(io.BytesIO(formatted["image/png"])) as image:
        assert image.format == "PNG"
    assert len(formatted["text/plain"]) < 200


def test_awkward_names_and_empty_data_draw_without_a_warning():
    name, times = "$x_1$ 深さ\n" + "long" * 30, np.linspace(0.0, 1.0, 5)
    trace = ForceTrace(
        name, times, {name: np.full(5, np.nan), "q": np.zeros(5)}, dict.fromkeys((name, "q"), np.zeros(5))
    )
    made = diagnosis("named", samples=20)
    overlay = dataclasses.replace(made.overlays[0], run=name, measured=dict.fromkeys(CHANNELS, np.full(20, np.nan)))
    candidates = [dataclasses.replace(made.candidates[0], label=name, statistic=0.0)]
    made = dataclasses.replace(made, forces=[trace], overlays=[overlay], candidates=candidates, channels=[])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        pictures = draw(made)
    assert set(pictures) == FIGURES["named"]
    assert drawable("深$") == "□$"
    assert len(drawable(name)) == 40


def test_significant_times_are_shaded():
    made = diagnosis("unknown")
    unshaded = [dataclasses.replace(place, times=[]) for place in made.where]
    drawn = []
    for places in (made.where, unshaded):
        with style(), Image.open(io.BytesIO(draw_forces(dataclasses.replace(made, where=places)).png)) as image:
            drawn.append(np.asarray(image.convert("RGB")).astype(int))
    # The legend, and with it the figure's layout, differs in its last lines only.
    changed = np.abs(drawn[0] - drawn[1]).max(axis=-1) > 10
    shaded = [np.mean(half) for half in np.split(changed, 2, axis=1)]
    assert shaded[0] < 0.02 < 0.1 < shaded[1]  # sway and yaw are in the right column
