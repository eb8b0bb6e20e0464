"""Units as people write them convert to SI and back, and text that is no unit is refused quickly and with a hint."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jaxsub.units import UnknownUnit, from_si, si_unit, to_si

CASES = [
    ("", 1.0, ""),
    ("1", 1.0, ""),
    ("m", 1.0, "m"),
    ("percent", 0.01, ""),
    ("%", 0.01, ""),
    ("ms", 1e-3, "s"),
    ("deg", np.pi / 180, "rad"),
    ("deg/s", np.pi / 180, "rad/s"),
    ("deg s-1", np.pi / 180, "rad/s"),
    ("rpm", 2 * np.pi / 60, "rad/s"),
    ("knot", 1852 / 3600, "m/s"),
    ("m s-2", 1.0, "m/s²"),
    ("dbar", 1e4, "Pa"),
    ("cm^3", 1e-6, "m³"),
    ("cm**3", 1e-6, "m³"),
    ("g/cm^3", 1e3, "kg/m³"),
    ("kN m", 1e3, "N m"),
    ("N/(m/s)", 1.0, "kg/s"),
    ("mV", 1e-3, "V"),
    ("g", 1e-3, "kg"),
]


@pytest.mark.parametrize(("unit", "factor", "si"), CASES)
def test_known_unit_converts_to_si_and_back(unit, factor, si):
    values = np.array([[-2.0, 0.0], [np.nan, 3.5]])
    np.testing.assert_allclose(to_si(values, unit), factor * values, rtol=1e-12)
    np.testing.assert_allclose(from_si(factor * values, unit), values, rtol=1e-12)
    assert si_unit(unit) == si


def test_temperature_has_an_offset():
    np.testing.assert_allclose(to_si(np.array([0.0, 20.0]), "degC"), [273.15, 293.15])
    np.testing.assert_allclose(from_si(np.array([273.15]), "degC"), [0.0], atol=1e-12)
    assert si_unit("degC") == "K"


def test_si_units_leave_every_bit_and_the_argument_alone():
    values = np.array([0.1, -0.0, 5e-324, 1e308])
    for unit in ("m", "rad/s", "kg", "N", "1", ""):
        converted = to_si(values, unit)
        assert converted.tobytes() == values.tobytes()
        assert not np.shares_memory(converted, values)


def test_overflow_is_infinite_and_warns_of_nothing():
    assert to_si(np.array([1e308]), "km")[0] == np.inf


@pytest.mark.parametrize(("unit", "hint"), [("knots/", "knot"), ("dge/s", "deg/s"), ("furlish", "write it like")])
def test_unknown_unit_comes_with_a_hint(unit, hint):
    with pytest.raises(UnknownUnit) as caught:
        to_si(np.ones(1), unit)
    assert caught.value.unit == unit
    assert hint in caught.value.remedy


@pytest.mark.parametrize(
    "unit", ["9**9**9**9**9", "m^9^9^9", "m ^9 ^9 ^9", "m^(9)^9", "1e999", "m" * 10_000, "()", "(m", "km⁹⁹⁹⁹"]
)
def test_hostile_text_is_refused(unit):
    with pytest.raises(UnknownUnit):
        si_unit(unit)


@settings(derandomize=True, deadline=None)
@given(st.text(st.sampled_from("mskg°%deg^*/·()-129⁹ \n_C"), max_size=12) | st.text(max_size=12))
def test_any_text_is_a_unit_or_unknown(unit):
    try:
        converted = to_si(np.ones(2), unit)
    except UnknownUnit:
        return
    assert converted.shape == (2,)
    assert "\n" not in si_unit(unit)
