"""A function of lanes says in each lane what NumPy says of that lane's numbers."""

import ctypes
import shutil
import subprocess

import casadi
import numpy as np
import pytest

from jaxsub.errors import InputError
from jaxsub.symbolic.lanes import HEADER, lanes_c

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
MEMBERS = 8
ALIKE = "sqrt sin cos tan sinh cosh tanh exp expm1 log log1p floor ceil fabs sign"
ONE = {name: getattr(np, name) for name in ALIKE.split()}
ONE |= {"asin": np.arcsin, "acos": np.arccos, "atan": np.arctan, "logic_not": lambda x: 1.0 * (x == 0.0)}
TWO = {"fmod": np.fmod, "fmin": np.fmin, "fmax": np.fmax, "atan2": np.arctan2, "copysign": np.copysign}
TWO |= {"power": np.power, "logic_and": np.logical_and, "logic_or": np.logical_or}


def in_lanes(function, given, folder, flags):
    """The function's C on numbers (arguments, MEMBERS), compiled with those flags, as many at once as it has lanes."""
    source = HEADER.read_text() + lanes_c(function)
    source += f"int lanes(void) {{ return LANES; }}\nvoid all(const V *x, V *y) {{ {function.name()}(x, y); }}\n"
    (folder / "lanes.c").write_text(source)
    for last in (["-lmvec", "-lm"], ["-lm"]):
        command = ["cc", *flags, "-Wno-psabi", "-shared", "-fPIC", str(folder / "lanes.c"), "-o", str(folder / "l.so")]
        if subprocess.run([*command, *last], capture_output=True).returncode == 0:
            break
    whole = ctypes.CDLL(str(folder / "l.so"))
    lanes = whole.lanes()
    assert MEMBERS % lanes == 0
    parts = [called(whole, part, function.nnz_out(0)) for part in np.split(given, MEMBERS // lanes, axis=1)]
    return np.concatenate(parts, axis=1)


def called(whole, given, results):
    """The results (results, lanes) of one call on numbers (arguments, lanes)."""
    arguments, lanes = given.shape
    memory = np.zeros((arguments + results + 1, lanes))
    # vectors lie at whole multiples of their size
    offset = -memory.ctypes.data % (8 * lanes) // 8
    flat = memory.ravel()[offset:]
    flat[: given.size] = given.ravel()
    at = flat.ctypes.data
    whole.all(ctypes.c_void_p(at), ctypes.c_void_p(at + 8 * given.size))
    return flat[given.size : given.size + lanes * results].reshape(-1, lanes).copy()


@pytest.mark.parametrize("flags", [["-O2", "-ftree-vectorize", "-march=native", "-fno-math-errno"], ["-O0"]])
def test_every_operation_is_numpys(tmp_path, flags):
    x = casadi.SX.sym("x", 2)
    a, b = x[0], x[1]
    found = [getattr(casadi, name)(a) for name in ONE] + [getattr(casadi, name)(a, b) for name in TWO]
    found += [
        a + b,
        a - b,
        a * b,
        a / b,
        -a,
        1.0 / a,
        a < b,
        a <= b,
        a == b,
        a != b,
        casadi.if_else(a < b, a, 7.0),
        a**3.7,
    ]
    given = np.random.default_rng(3).uniform(0.05, 0.95, (2, MEMBERS))
    given[1, 2] = given[0, 2]
    p, q = given
    expected = [f(p) for f in ONE.values()] + [f(p, q) for f in TWO.values()]
    expected += [
        p + q,
        p - q,
        p * q,
        p / q,
        -p,
        1.0 / p,
        p < q,
        p <= q,
        p == q,
        p != q,
        np.where(p < q, p, 7.0),
        p**3.7,
    ]
    answer = in_lanes(casadi.Function("f", [x], [casadi.vertcat(*found)]), given, tmp_path, flags)
    np.testing.assert_allclose(answer, np.array(expected, float), rtol=2e-15, atol=1e-16)


def test_what_is_not_chosen_is_not_seen(tmp_path):
    """A NaN on the other side of a choice leaves no trace, whichever lane it is in."""
    x = casadi.SX.sym("x")
    root = casadi.if_else(x > 0.0, casadi.sqrt(x), -1.0)
    given = np.linspace(-2.0, 2.0, MEMBERS)
    answer = in_lanes(casadi.Function("f", [x], [root]), given[None], tmp_path, ["-O2"])
    np.testing.assert_allclose(answer[0], np.where(given > 0.0, np.sqrt(np.abs(given)), -1.0), rtol=1e-15)


def test_an_operation_without_a_form_is_refused_by_name():
    x = casadi.SX.sym("x")
    with pytest.raises(InputError, match="erfinv"):
        lanes_c(casadi.Function("f", [x], [casadi.erfinv(x)]))
