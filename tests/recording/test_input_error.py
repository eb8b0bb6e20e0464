"""An InputError is one line of where, what and remedy, and a misspelt word finds the one it was meant to be."""

import pytest

from jaxsub.errors import InputError, nearest


def test_message_is_one_line_whatever_is_quoted_in_it():
    error = InputError("a.csv, row 3", "library says:\n\tno\r\nway\u2028", "fix it")
    assert str(error) == "a.csv, row 3: library says: no way ; fix it"
    assert isinstance(error, ValueError)


@pytest.mark.parametrize(
    ("word", "expected"), [("Y_vdott", "Y_vdot"), ("y_vdot", "Y_vdot"), ("masss", "mass"), ("zzz", None), ("", None)]
)
def test_nearest(word, expected):
    assert nearest(word, ["Y_vdot", "Y_v", "mass"]) == expected
    assert nearest(word, []) is None
