"""Coefficients that follow from others: `K_delta_el = "-K_delta_er"`."""

import ast
import dataclasses
import math
import operator
import re
from collections.abc import Callable, Mapping
from typing import Any

from ..effects import derivative
from ..errors import InputError, suggestion

# a symbol such as Y_v|v|, Y_vvv/U or bow.gain; not the exponent of a number such as 2.5e-3
_NAME = re.compile(r"(?<![\w.])[A-Za-z_][\w|]*(?:/U+(?!\w)|\.[A-Za-z_]\w*)?")
_MOST = 200  # characters
_UNITS = (2.0, 3.0, 5.0)  # of mass, length and time, in which dimensions are compared
_BINARY: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}  # fmt: skip
_HINT = 'write an expression of other numbers with + - * / ** and brackets, such as "-K_delta_er"'


@dataclasses.dataclass(frozen=True)
class Tie:
    """The number `name` of a vehicle as an expression of others.

    **Fields**

    - `name`: the number that follows. `text`: the expression, as in the vehicle file; its numbers are SI.
    - `names`: those that it follows. `section`: of the vehicle file, that has it.
    """

    name: str
    text: str
    names: tuple[str, ...]
    section: str = "coefficients"

    def of(self, values: Mapping[str, Any]) -> Any:
        """The number for `values` of the others: floats or arrays, differentiable by them."""
        named = {f"_{i}": values[name] for i, name in enumerate(self.names)}
        return _value(_parsed(self.text, self.names), named)


def read_tie(name: str, text: str, place: str, section: str = "coefficients") -> Tie:
    """The tie that a vehicle file gives in place of a number of its `section`.

    **Raises** `InputError` for what is no expression of other numbers.
    """
    if len(text) > _MOST:
        raise InputError(place, f"has {len(text)} characters", f"write {_MOST} at most")
    names = tuple(dict.fromkeys(_NAME.findall(text)))
    if not names:
        raise InputError(place, f"{text!r:.60} names no other number", "write a number without quotation marks")
    try:
        tree = _parsed(text, names)
        _value(tree, {f"_{i}": 1.0 for i in range(len(names))})
    except (SyntaxError, TypeError, ValueError) as error:
        raise InputError(place, f"{text!r:.60} is no expression", _HINT) from error
    except ArithmeticError:
        pass  # at one for each; its own numbers are judged below
    return Tie(name, text, names, section)


def tied_values(ties: tuple[Tie, ...], values: Mapping[str, float], where: str) -> dict[str, float]:
    """The numbers that follow from `values`.

    **Raises** `InputError` for a tie to a number that there is not or that is tied itself, and for one without a value.
    """
    found, tied = {}, {tie.name for tie in ties}
    for tie in ties:
        place = f"{where}: {tie.section}.{tie.name}"
        for name in tie.names:
            if name in tied:
                raise InputError(place, f"follows {name}, which follows others", "write it in terms of those")
            if name not in values:
                hint = suggestion(name, values, f"known: {', '.join(values)}")
                raise InputError(place, f"follows {name}, which is no number of the vehicle", hint)
        try:
            value = tie.of(values)
        except ArithmeticError:
            value = math.nan
        if not isinstance(value, float) or not math.isfinite(value):
            raise InputError(place, f"{tie.text!r:.60} has no finite value", "mend the expression")
        _check_dimension(tie, place)
        found[tie.name] = value
    return found


def _check_dimension(tie: Tie, place: str) -> None:
    """Refuse an expression of derivatives alone whose dimension is another; a number in it may have any dimension."""
    terms = {name: derivative(name) for name in (tie.name, *tie.names)}
    numbers = any(isinstance(part, ast.Constant) for part in ast.walk(_parsed(tie.text, tie.names)))
    if numbers or any(term is None or not term.dimensional for term in terms.values()):
        return
    # in other units of mass, length and time the expression has to change as the number does
    change = {
        name: math.prod(u**k for u, k in zip(_UNITS, term.dimension, strict=True))
        for name, term in terms.items()
        if term
    }
    values = {name: 1.3 + i for i, name in enumerate(tie.names)}
    other = tie.of({name: value * change[name] for name, value in values.items()})
    if not math.isclose(other, tie.of(values) * change[tie.name], rel_tol=1e-9):
        what = f"{tie.text!r:.60} has another dimension than {tie.name}"
        raise InputError(place, what, "multiply by a number in SI, such as a lever arm in m")


def _parsed(text: str, names: tuple[str, ...]) -> ast.expr:
    plain = _NAME.sub(lambda match: f"_{names.index(match[0])}", text)
    return ast.parse(plain.strip(), mode="eval").body


def _value(tree: ast.expr, named: Mapping[str, Any]) -> Any:
    match tree:
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
            return float(number)
        case ast.Name(id=name) if name in named:
            return named[name]
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return -_value(operand, named)
        case ast.UnaryOp(op=ast.UAdd(), operand=operand):
            return _value(operand, named)
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _BINARY:
            return _BINARY[type(op)](_value(left, named), _value(right, named))
    raise ValueError(f"{type(tree).__name__} is no arithmetic")
