"""The checker of the tests refuses what an annotation does not allow."""

import dataclasses
import importlib
import sys
import textwrap

import equinox as eqx
import numpy as np
import pytest
import typechecking
from beartype.roar import BeartypeCallHintViolation

MODULE = '''
"""A module of functions and classes to be checked."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Self

import equinox as eqx
import numpy as np
from jaxtyping import Float

if TYPE_CHECKING:
    from somewhere import Unknown


def total(values: Sequence[float], label: "str" = "", other: "Unknown" = None) -> float:
    return label or float(sum(values))


def product(left: Float[np.ndarray, "n m"], right: Float[np.ndarray, " m"]) -> Float[np.ndarray, " n"]:
    return left @ right


def columns(table: Mapping[str, Float[np.ndarray, " n"]]) -> Sequence[int]:
    return [product(np.ones((2, value.size)), value).size for value in table.values()]


class Body(eqx.Module):
    mass: float

    def scaled(self, factor: float) -> Self:
        def inner(mass: float) -> float:
            return "heavy" if mass > 100.0 else mass

        return Body(inner(self.mass * factor))


@dataclasses.dataclass(frozen=True)
class Place:
    x: float
'''


@pytest.fixture(scope="module")
def module(tmp_path_factory):
    """The module, imported under the checker; nothing of it stays."""
    folder = tmp_path_factory.mktemp("checked")
    (folder / "checked_example.py").write_text(textwrap.dedent(MODULE))
    sys.path.insert(0, str(folder))
    finders = list(sys.meta_path)
    typechecking.install("checked_example")
    yield importlib.import_module("checked_example")
    sys.meta_path[:] = finders
    sys.path.remove(str(folder))
    del sys.modules["checked_example"]
    assert not (folder / "__pycache__").exists()  # where an import without the checker would find it


def test_what_is_annotated_is_let_through(module):
    """Claim: right types and shapes, of dimensions that differ between nested calls, raise nothing."""
    assert module.total([1.0, 2.0]) == 3.0
    assert module.columns({"a": np.ones(3), "b": np.ones(3)}) == [2, 2]
    assert module.Body(2.0).scaled(3.0).mass == 6.0
    assert module.Place(1.0) == dataclasses.replace(module.Place(2.0), x=1.0)
    assert eqx.tree_equal(module.Body(2.0), module.Body(2.0))


@pytest.mark.parametrize(
    "wrong",
    [
        lambda module: module.total("text"),
        lambda module: module.total([], label=3),
        lambda module: module.total([], label="returned"),
        lambda module: module.product(np.ones((2, 3)), np.ones(2)),
        lambda module: module.product(np.ones(3), np.ones(3)),
        lambda module: module.columns({"a": np.ones(3), "b": np.ones((3, 1))}),
        lambda module: module.Body("heavy"),
        lambda module: module.Body(200.0).scaled(2.0),
        lambda module: module.Place("here"),
    ],
)
def test_what_is_annotated_otherwise_is_refused(module, wrong):
    """Claim: arguments, results, shapes, fields, methods and inner functions are checked."""
    with pytest.raises(BeartypeCallHintViolation):
        wrong(module)


def test_the_package_is_imported_under_the_checker():
    """Claim: functions of jaxsub are checked in this very process."""
    from jaxsub.report.text import percent

    with pytest.raises(BeartypeCallHintViolation):
        percent("half")
