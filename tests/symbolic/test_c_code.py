"""C of a function says what the function says, and needs nothing but a C compiler."""

import shutil
import subprocess
from concurrent.futures import ThreadPoolExecutor

import jax.numpy as jnp
import numpy as np
import pytest

from jaxsub.errors import InputError
from jaxsub.symbolic import casadi_function, compiled, write_c

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")


def _turned(x, M):
    return M @ jnp.sin(x), jnp.where(x > 0.0, jnp.sqrt(jnp.abs(x)), jnp.nan)


def test_compiled_code_agrees():
    """With the function itself, NaN included, call after call."""
    native = compiled(casadi_function(_turned, jnp.zeros(3), jnp.zeros((2, 3)), name="turned"))
    rng = np.random.default_rng(2)
    for _ in range(3):
        x, M = rng.normal(size=3), rng.normal(size=(2, 3))
        native.given[0][:], native.given[1][:] = x, M.T.ravel()
        native()
        for found, expected in zip(native.found, _turned(x, M), strict=True):
            np.testing.assert_allclose(found, expected, rtol=1e-14)


def test_the_file_stands_alone(tmp_path):
    """Compiled with a `main` of its own by a C99 compiler that is told to be strict."""
    path = tmp_path / "turned.c"
    write_c(casadi_function(lambda x: 2.0 * jnp.exp(x), jnp.zeros(2), name="twice"), path)
    main = """
    #include <stdio.h>
    int main(void) {
        double x[2] = {0.0, 1.0}, y[2], w[64];
        const double* arg[4] = {x};
        double* res[4] = {y};
        long long iw[4];
        twice(arg, res, iw, w, 0);
        printf("%.17g %.17g", y[0], y[1]);
        return 0;
    }
    """
    path.write_text(path.read_text() + main)
    subprocess.run(["cc", "-std=c99", str(path), "-o", str(tmp_path / "a"), "-lm"], check=True)
    said = subprocess.run([str(tmp_path / "a")], check=True, capture_output=True, text=True).stdout
    np.testing.assert_allclose([float(word) for word in said.split()], 2.0 * np.exp([0.0, 1.0]), rtol=1e-15)


def test_a_missing_compiler_is_one_clear_line(monkeypatch):
    monkeypatch.setenv("CC", "no-such-compiler")
    with pytest.raises(InputError, match=r"no-such-compiler: no C compiler of this name; install one"):
        compiled(casadi_function(jnp.sin, jnp.zeros(1)))


def test_threads_on_one_object_do_not_see_each_others_numbers():
    """Arrays large enough that calls overlap: the lock of the interpreter is released in each."""
    size = 400
    native = compiled(casadi_function(lambda x: jnp.cumsum(jnp.sin(x)), jnp.zeros(size), name="summed"))

    def answers(seed):
        rng, found = np.random.default_rng(seed), []
        for _ in range(300):
            native.given[0][:] = rng.normal(size=size)
            native()
            found.append(native.found[0].copy())
        return np.array(found)

    serial = [answers(seed) for seed in range(4)]
    with ThreadPoolExecutor(4) as pool:
        for found, expected in zip(pool.map(answers, range(4)), serial, strict=True):
            np.testing.assert_array_equal(found, expected)
