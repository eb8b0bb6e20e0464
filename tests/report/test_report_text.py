"""Numbers keep their size and stated precision when they are written for people, and symbols are set, not altered."""

import math
import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jaxsub.report.text import (
    formula,
    measurement,
    number,
    p_equals,
    p_value,
    percent,
    plain_label,
    prose,
    ratio,
    symbol,
    typeset_label,
    unit,
)

quick = settings(derandomize=True, deadline=None, max_examples=300)
sizes = st.builds(
    lambda m, e, s: s * m * 10.0**e, st.floats(1, 9.999), st.integers(-290, 290), st.sampled_from([-1, 1])
)
BACK = str.maketrans("−⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "--0123456789")


def parsed(text):
    """The number that a reader sees."""
    mantissa, _, power = text.partition(" × 10")
    return float(f"{mantissa.translate(BACK)}e{power.translate(BACK) or 0}")


@quick
@given(value=sizes | st.just(0.0), digits=st.integers(1, 12))
def test_number_reads_back_to_its_digits(value, digits):
    text = number(value, digits)
    assert parsed(text) == pytest.approx(value, rel=0.501 * 10.0 ** (1 - digits), abs=0.0)
    assert len(re.sub(r" × 10.*|[^\d]", "", text).strip("0")) <= digits


@quick
@given(value=sizes, relative=st.floats(1e-6, 1e3))
def test_measurement_reads_back_within_its_error(value, relative):
    error = abs(value) * relative
    text = measurement(value, error)
    match = re.fullmatch(r"\(?(\S+) ± ([^\s)]+)\)?( × 10\S+)?", text)
    assert match, text
    power = match[3] or ""
    shown_value, shown_error = parsed(match[1] + power), parsed(match[2] + power)
    assert shown_error == pytest.approx(error, rel=0.051)
    assert abs(shown_value - value) <= 0.0501 * error + 1e-12 * abs(value)
    decimals = [len(part.partition(".")[2]) for part in match.groups()[:2]]
    assert decimals[0] == decimals[1]


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (0.61372, 0.0214, "0.614 ± 0.021"),
        (-4093.9, 123.0, "−4090 ± 120"),
        (3.2e-5, 1.04e-6, "(3.20 ± 0.10) × 10⁻⁵"),
        (1.0, 0.0996, "1.00 ± 0.10"),
        (-0.001, 3.0, "0.0 ± 3.0"),
        (0.0, 0.02, "0.000 ± 0.020"),
        (12.5, math.inf, "12.5 ± ∞"),
        (12.5, 0.0, "12.5"),
        (12.5, math.nan, "12.5"),
        (math.nan, math.nan, "–"),
    ],
)
def test_measurement_cases(value, error, text):
    assert measurement(value, error) == text


@pytest.mark.parametrize(
    ("p", "text"),
    [
        (0.0, "< 10⁻³⁰⁰"),
        (1e-310, "< 10⁻³⁰⁰"),
        (3.21e-40, "3.2 × 10⁻⁴⁰"),
        (0.0123, "0.012"),
        (1.0, "1"),
        (math.nan, "–"),
    ],
)
def test_p_value_never_claims_zero(p, text):
    assert p_value(p) == text


def test_a_sentence_has_one_relation_of_p():
    assert [p_equals(p) for p in (0.031, 0.0)] == ["p = 0.031", "p < 10⁻³⁰⁰"]


@quick
@given(share=st.floats(0.0, 1.0))
def test_percent_claims_certainty_only_when_certain(share):
    shown = percent(share).replace("\N{NARROW NO-BREAK SPACE}", "")
    assert (shown == "100%") == (share == 1.0)
    assert (shown == "0%") == (share == 0.0)
    assert abs(float(shown.strip("<>% ")) - 100.0 * share) <= 0.5001


def test_ratio_has_three_digits():
    shown = [ratio(value) for value in (0.998, 9.994, 9.996, 99.96, 1234.5, None, math.nan)]
    assert shown == ["1.00", "9.99", "10.0", "100", "1230", "–", "–"]


def test_symbols_units_and_formulas_are_set():
    assert [symbol(name) for name in ("phi", "psi", "u", "phi_2", "delta_r")] == ["φ", "ψ", "u", "φ_2", "δ_r"]
    assert [symbol(name) for name in ("phi_rate", "depth_rate")] == ["φ\N{COMBINING DOT ABOVE}", "depth_rate"]
    assert plain_label("sensor-bias[psi,delta_r]") == "sensor-bias[ψ,δ_r]"
    assert typeset_label("lag[delta_r]<") == "lag[δ<sub>r</sub>]&lt;"
    assert prose("psi is left at 2 σ; see logs/psi.csv and delta_r") == (
        "ψ is left at 2 σ; see logs/psi.csv and δ<sub>r</sub>"
    )
    assert [unit(text) for text in ("1", "N*m/(rad/s)/(rad/s)", "m/s/s", "m s^-2")] == [
        "",
        "N m/(rad/s)²",
        "m/s²",
        "m s⁻²",
    ]
    assert formula("-C_d abs(v) v - T d(delta_r)/dt") == "−C<sub>d</sub> |v| v − T d(δ<sub>r</sub>)/dt"
    assert formula("v*abs(v)") == "v |v|"
    assert formula("Y_vdot < quadratic-damping") == "Y<sub>v̇</sub> &lt; quadratic-damping"
