"""Programs kept on disk: the same numbers as without, no tracing in the next process, and never another program."""

import dataclasses
import functools
import subprocess
import sys
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxsub.fingerprint import NoDigestError, digest
from jaxsub.parameters import Parameter, Transform
from jaxsub.programs import compiled, keep_programs

# two coefficients of a transform, one with a bound on either side
_TRANSFORM = """
import json, sys
from pathlib import Path
import jax, numpy as np
jax.config.update("jax_enable_x64", True)
from jaxsub import parameters
from jaxsub.programs import keep_programs
traced = []
own = parameters._of_softplus
parameters._of_softplus = lambda gap: traced.append(gap) or own(gap)
transform = parameters.Transform(*np.array([[0.0, -np.inf], [2.0, np.inf], [1.0, 3.0], [1.0, 3.0]]))
plain = transform.to_free(np.array([0.7, 5.0]))
del traced[:]
keep_programs(Path(sys.argv[1]))
kept = transform.to_free(np.array([0.7, 5.0]))
print(json.dumps([len(traced), np.asarray(plain).tolist(), np.asarray(kept).tolist()]))
"""


@pytest.fixture
def folder(tmp_path):
    """Programs are kept in it for the time of a test."""
    keep_programs(tmp_path)
    yield tmp_path
    keep_programs(None)


def _transform(lower=0.0):
    return Transform.of([Parameter("a", lower=lower, upper=2.0), Parameter("b")], np.array([1.0, 3.0]))


def test_the_next_process_gets_the_same_numbers_without_tracing(tmp_path):
    """A process that finds the program does not run the function, and has the plain program's numbers bit for bit."""
    root = str(Path(__file__).parents[2])
    ran = [
        subprocess.run(
            [sys.executable, "-c", _TRANSFORM, str(tmp_path)],
            capture_output=True, text=True, check=True, env={"PYTHONPATH": root, "JAX_PLATFORMS": "cpu"},
        ).stdout
        for _ in range(2)
    ]  # fmt: skip
    (first, plain, kept), (second, *again) = map(eval, ran)
    assert first > 0 and second == 0
    assert plain == kept == again[0] == again[1]


@pytest.mark.parametrize("damage", [lambda content: content[:-3], lambda content: b"", lambda content: content[::-1]])
def test_a_damaged_program_is_replaced(folder, damage):
    """Cut short, emptied or garbled, a kept program is made anew and kept again."""
    theta = np.array([0.7, 5.0])
    asked = lambda: np.asarray(compiled(Transform.to_free.__wrapped__)(_transform(), theta))
    expected = asked()
    (path,) = folder.iterdir()
    path.write_bytes(damage(path.read_bytes()))
    np.testing.assert_array_equal(asked(), expected)
    # a file that is written again has another inode; when it was read does not count
    written = lambda: (path.stat().st_ino, path.stat().st_mtime_ns, path.read_bytes())
    mended = written()
    np.testing.assert_array_equal(asked(), expected)
    assert written() == mended and list(folder.iterdir()) == [path]


def test_where_nothing_can_be_written_the_numbers_are_the_same(folder):
    """A folder that has gone costs time, not an answer."""
    folder.rmdir()
    theta = np.array([0.2, 4.0])
    kept = compiled(Transform.to_free.__wrapped__)(_transform(), theta)
    np.testing.assert_array_equal(kept, eqx.filter_jit(Transform.to_free.__wrapped__)(_transform(), theta))


def test_derivatives_and_batches_are_those_of_the_function(folder):
    """`grad` and `vmap` go through a kept program as through the function, also beside its own call."""
    transform, theta = _transform(), jnp.array([0.7, 5.0])
    again = compiled(Transform.to_free.__wrapped__)
    value, slope = again(transform, theta), jax.jacfwd(functools.partial(again, transform))(theta)
    step = 1e-6
    numeric = (again(transform, theta + step) - again(transform, theta - step)) / (2.0 * step)
    np.testing.assert_allclose(jnp.diag(slope), numeric, rtol=1e-8)
    many = jax.vmap(functools.partial(again, transform))(jnp.stack([theta, theta]))
    np.testing.assert_allclose(many, jnp.stack([value, value]), rtol=1e-15)


def test_a_function_of_the_user_is_not_kept(folder):
    """Code that no digest stands for runs as ever, and leaves nothing behind."""
    ours = compiled(lambda x: 2.0 * x)
    assert float(ours(np.float64(3.0))) == 6.0
    assert not list(folder.iterdir())


class _Scaled(eqx.Module):
    factor: jax.Array
    kind: object = eqx.field(static=True)


@dataclasses.dataclass(frozen=True)
class _Own:
    number: float


def _of(*arguments):
    return digest(jnp.cumsum, arguments)


@pytest.fixture
def trusted(monkeypatch):
    """As if this file were one of jaxsub's, whose source is in every digest."""
    monkeypatch.setattr("jaxsub.fingerprint._STANDARD", ("builtins", __name__.split(".")[0]))


def _closure(held):
    return lambda x: x * held


_A = np.array([1.0, 2.0])
_SAME_LINE = [lambda x: x + 1.0, lambda x: x + 2.0]


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (_A, np.array([1.0, 2.0, 3.0])),
        (_A, _A.astype(np.float32)),
        (jnp.asarray(1.0), jnp.float64(1.0)),
        (1.0, 2.0),
        (1, True),
        ("a", b"a"),
        ((_A, None), (None, _A)),
        ([_A], (_A,)),
        ({"a": _A}, {"b": _A}),
        (_Scaled(_A, "linear"), _Scaled(_A, "full")),
        (_Scaled(_A, (1, (2, 3))), _Scaled(_A, (1, 2, 3))),
        (_Own(1.0), _Own(2.0)),
        (_closure(2.0), _closure(3.0)),
        (_closure(_A), _closure(2.0 * _A)),
        (functools.partial(jnp.cumsum, axis=0), functools.partial(jnp.cumsum, axis=1)),
        (jnp.cumsum, jnp.cumprod),
        (_SAME_LINE[0], _SAME_LINE[1]),
    ],
    ids=lambda part: type(part).__name__,
)
def test_what_a_program_depends_on_changes_its_digest(trusted, one, other):
    """Two things that a trace would tell apart have two digests, and each has the same one again."""
    assert _of(one) != _of(other)
    assert _of(one) == _of(one)


def test_values_of_arrays_do_not_change_a_digest_and_settings_do(trusted):
    """One program serves all values of its arrays, and none serves two settings of JAX."""
    module = _Scaled(_A, "full")
    assert _of(module, _A) == _of(eqx.tree_at(lambda m: m.factor, module, 5.0 * _A), -_A)
    before = _of(_A)
    with jax.default_matmul_precision("highest"):
        assert _of(_A) != before


def _itself():
    ring = []
    ring.append(ring)
    return ring


@pytest.mark.parametrize("what", [_itself(), object(), iter([1.0]), _Own(1.0)], ids=lambda part: type(part).__name__)
def test_what_is_not_known_has_no_digest(what):
    """Objects of unknown kinds or from elsewhere, and rings, are refused rather than guessed."""
    with pytest.raises(NoDigestError):
        _of(what)
