"""A column of a log is its channel scaled and shifted as written, whatever the channel's name holds, and no more."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jaxsub.errors import InputError
from jaxsub.recording.logs import Selection, Series
from jaxsub.recording.logs.arithmetic import Term, parse_term
from jaxsub.recording.logs.load import _column

numbers = st.floats(-1e6, 1e6).filter(lambda x: abs(x) > 1e-6).map(lambda x: float(f"{x:.6g}"))
names = st.from_regex(r"/?[a-zA-Z_][\w.\[\]/-]{0,12}[\w\]]", fullmatch=True)


@pytest.mark.parametrize(
    ("text", "term"),
    [
        ("(x - 1500) * 0.001", Term(0.001, "", "x", -1.5)),
        ("90 - x", Term(-1.0, "", "x", 90.0)),
        ("-x", Term(-1.0, "", "x")),
        ("25*/fin.data", Term(25.0, "", "/fin.data")),
        ("0.35 * a/b-c.d[0] + 2", Term(0.35, "", "a/b-c.d[0]", 2.0)),
        ("x / 4", Term(0.25, "", "x")),
        ("-(unwrap(/imu.yaw) - 1) / 2", Term(-0.5, "unwrap", "/imu.yaw", 0.5)),
        ("3d_pose.x", Term(1.0, "", "3d_pose.x")),
        ("x - 0.5 * x", Term(0.5, "", "x")),
    ],
)
def test_expression_is_a_line_in_its_channel(text, term):
    assert parse_term(text) == term


@given(name=names, a=numbers, b=numbers, c=numbers)
def test_written_arithmetic_is_done(name, a, b, c):
    # `of` has no part of a number's spelling, so that a name is none
    term = parse_term(f"{a!r} * (of{name} - {b!r}) / {c!r}")
    assert term.channel == f"of{name}"
    np.testing.assert_allclose([term.factor, term.offset], [a / c, -a * b / c])


@given(st.text(max_size=40) | st.text("x1 +-*/()[].", max_size=40))
def test_any_text_is_a_term_or_one_reason(text):
    try:
        term = parse_term(text)
    except ValueError as error:
        assert str(error)
    else:
        assert np.isfinite([term.factor, term.offset]).all() and term.factor


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("a + b", "takes a and b, and a column comes from one channel"),
        ("x * x", "multiplies its channel by itself"),
        ("1 / x", "divides by its channel"),
        ("x / 0", "divides by zero"),
        ("x - x", "is 0 times its channel"),
        ("12", "names no channel"),
        ("(" * 160 + "x" + ")" * 160, "is longer than"),
        ("9 ** 9 * x", "cannot be read from"),
    ],
)
def test_other_arithmetic_is_refused_in_one_line(text, why):
    with pytest.raises(InputError, match=r"map.toml, column 'r': ") as caught:
        Selection({"r": text}, source="map.toml").term("r")
    assert why in str(caught.value)


def test_header_states_the_unit_of_the_result():
    series = Series(np.arange(2.0), np.array([0.0, 90.0]), "")
    turned = _column("map", "psi", series, parse_term("90 - x"), "deg")
    np.testing.assert_allclose(turned.values, [np.pi / 2, 0.0])
    assert turned.unit == "rad"


def test_euler_angles_are_in_rad():
    series = Series(np.arange(2.0), np.array([0.0, 1.0]), "rad")
    with pytest.raises(InputError, match=r"yaw\(\) is in rad, not deg; head it psi or psi\[rad\]"):
        _column("map", "psi", series, parse_term("yaw(q)"), "deg")
