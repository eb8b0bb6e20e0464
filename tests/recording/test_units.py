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
_DEG, _TURN = np.pi / 180, 2 * np.pi
# as people write them: one SI unit, what it is in it, and the spellings
SPELLINGS = [
    ("rad", 1.0, "rad Rad RAD rads radian radians"),
    ("rad", 1e-3, "mrad milliradian millirad"),
    ("rad", _DEG, "deg Deg DEG degs degree degrees ° º degT degM degrees_north degrees_true degree_east"),
    ("rad", 1e-7 * _DEG, "degE7 1e-7|deg 1e-7|degrees"),
    ("rad", 0.01 * _DEG, "cdeg 0.01|deg centidegrees"),
    ("rad", _TURN, "rev revs turn revolutions cycles"),
    ("rad/s", _DEG, "deg/s deg|s-1 deg.s-1 deg·s⁻¹ °/s degrees/sec dps DPS deg_per_s deg|per|second deg*s^-1"),
    ("rad/s", _TURN, "rev/s rps RPS turns/s revs/sec"),
    ("rad/s", _TURN / 60, "rpm RPM Rpm rev/min r/min"),
    ("rad/s²", _DEG, "deg/s^2 deg/s² deg/s/s deg|s-2 deg/s2"),
    ("m/s", 1.0, "m/s m.s-1 m|s-1 m·s⁻¹ mps m/sec M/S meters/second metres|per|second m_per_s"),
    ("m/s", 1852 / 3600, "kn kt kts knot knots Knots nmi/h"),
    ("m/s", 1 / 3.6, "km/h kph kmh KM/H"),
    ("m/s²", 1.0, "m/s^2 m/s² m/s2 m/s/s m.s-2 m·s⁻²"),
    ("m/s²", 9.80665, "g_n g0 standard_gravity g's gees"),
    ("m", 1.0, "m meter meters metre Metres"),
    ("m", 1e-3, "mm millimeters"),
    ("m", 1e3, "km KM kilometres"),
    ("m", 0.3048, "ft feet foot"),
    ("N", 1.0, "N newton Newtons kg.m/s2"),
    ("N m", 1.0, "N.m N*m N·m Nm N|m N-m newton-meters"),
    ("N m", 1e3, "kNm kN.m kN|m"),
    ("s", 1.0, "s sec secs second Seconds"),
    ("s", 60.0, "min mins minutes"),
    ("s", 3600.0, "h hr hrs hours"),
    ("s", 1e-3, "ms msec milliseconds"),
    ("s", 1e-6, "us µs μs usec microseconds"),
    ("Pa", 100.0, "mbar hPa millibar mb"),
    ("Pa", 1e4, "dbar decibar DBAR"),
    ("Pa", 1e3, "kPa KPa kpa kilopascals"),
    ("T", 1e-6, "uT µT μT microtesla"),
    ("T", 1e-4, "gauss Gs Gauss"),
    ("K", 1.0, "K kelvin"),
    ("kg", 1.0, "kg Kg KG kilogram kilograms"),
    ("kg/m³", 1.0, "kg/m3 kg.m-3 kg|m-3 kg/m^3 kg/m³ g/l"),
    ("m³", 1e-3, "l L liter litres"),
    ("V", 1.0, "V volt Volts"),
    ("A", 1.0, "A amp amps Ampere"),
    ("1/s", 1.0, "Hz hz HZ 1/s s-1 hertz"),
    ("", 1.0, "1 - -- unitless dimensionless PSU psu PSS-78 none n/a counts bool"),
    ("", 1e-3, "1e-3 0.001 1E-3 ml/l"),
    ("", 1e-2, "% percent pct Percent per|cent"),
]
CASES += [(unit.replace("|", " "), factor, si) for si, factor, row in SPELLINGS for unit in row.split()]


@pytest.mark.parametrize(("unit", "factor", "si"), CASES)
def test_known_unit_converts_to_si_and_back(unit, factor, si):
    values = np.array([[-2.0, 0.0], [np.nan, 3.5]])
    np.testing.assert_allclose(to_si(values, unit), factor * values, rtol=1e-12)
    np.testing.assert_allclose(from_si(factor * values, unit), values, rtol=1e-12)
    assert si_unit(unit) == si


@pytest.mark.parametrize("unit", ["degC", "°C", "Celsius", "deg C", "deg_C", "° C", "degrees_celsius", "DEGC"])
def test_temperature_has_an_offset(unit):
    np.testing.assert_allclose(to_si(np.array([0.0, 20.0]), unit), [273.15, 293.15])
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


def test_temperature_over_a_distance_has_none():
    np.testing.assert_allclose(to_si(np.ones(1), "degC/m"), 1.0)
    np.testing.assert_allclose(to_si(np.ones(1), "degF/s"), 5 / 9)


@pytest.mark.parametrize(
    ("unit", "hint"),
    [
        ("M", "m (metre)"), ("M/h", "m (metre)"), ("C", "degC"), ("F", "degF"), ("G", "gauss"), ("nm", "nmi"),
        ("NM", "N m"), ("ppt", "1e-3"), ("ton", "tonne"),
    ],
)  # fmt: skip
def test_unit_that_may_mean_several_is_refused_with_them(unit, hint):
    with pytest.raises(UnknownUnit, match="is ambiguous") as caught:
        to_si(np.ones(1), unit)
    assert hint in caught.value.remedy


@pytest.mark.parametrize("unit", ["KN", "MM", "rds", "dB", "0", "0 m", "m3s", "xyz", "m^2.5", "1e-400 m", "deg/"])
def test_text_of_no_clear_meaning_is_no_unit(unit):
    with pytest.raises(UnknownUnit):
        si_unit(unit)


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
