"""Coefficients that follow from others: `K_delta_el = "-K_delta_er"`."""

import ast
import dataclasses
import math
import operator
import re
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ..effects import derivative
from ..errors import InputError, suggestion
from ..parameters import Parameter
from .schema import Table, read_bounds, read_number, read_prior, stated_unit, unknown_key

# a symbol such as Y_v|v|, Y_vvv/U or bow.gain; not the exponent of a number such as 2.5e-3
_NAME = re.compile(r"(?<![\w.])[A-Za-z_][\w|]*(?:/U+(?!\w)|\.[A-Za-z_]\w*)?")
_MOST = 200  # characters
_UNITS = (2.0, 3.0, 5.0)  # of mass, length and time, in which dimensions are compared
_BINARY: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}  # fmt: skip
# what may stand beside an expression
_BESIDE = ("value", "bounds", "prior_std", "prior_mean", "unit")
_HINT = 'write an expression of other numbers with + - * / ** and brackets, such as "-K_delta_er"'


@dataclasses.dataclass(frozen=True)
class Tie:
    """The number `name` of a vehicle as an expression of others.

    **Fields**

    - `name`: the number that follows. `text`: the expression, as in the vehicle file; its numbers are SI.
    - `names`: those that it follows. `section`: of the vehicle file, that has it.
    - `unit`: its SI unit, empty where that is not known.
    - `lower`, `upper`, `prior_std`, `prior_mean`: bounds and prior of the number itself, SI, as `Parameter` has them,
      until `tied_rows` makes them bounds and prior of what it follows. Without a mean it is the value in the file.
    """

    name: str
    text: str
    names: tuple[str, ...]
    section: str = "coefficients"
    unit: str = ""
    lower: float = -math.inf
    upper: float = math.inf
    prior_std: float = math.inf
    prior_mean: float | None = None

    @property
    def alone(self) -> "Tie":
        """The same without bounds and prior."""
        return Tie(self.name, self.text, self.names, self.section, self.unit)

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


def read_entry(
    name: str, entry: Any, place: str, default: Parameter, section: str, ties: list[Tie], scale: float = 1.0
) -> tuple[float, Parameter]:
    """The number and its row, as `read_number` gives them; of an expression 0 and a fixed row.

    An expression, which is added to `ties`, stands alone or as `value` of a table. Its bounds and prior are in units of
    `scale`, SI.
    """
    if not is_tied(entry):
        return read_number(entry, place, default)
    table = Table(entry if isinstance(entry, dict) else {"value": entry}, place, "")
    for key in table.data:
        if key in ("fixed", "free", "varies", "spread"):
            remedy = f"delete it, or write it beside what this follows; beside an expression: {', '.join(_BESIDE[1:])}"
            raise InputError(f"{place}.{key}", "stands beside an expression", remedy)
        if key not in _BESIDE:
            raise unknown_key(f"{place}.{key}", _BESIDE, key)
    low, high = read_bounds(table, (-math.inf, math.inf), place)
    std, mean = read_prior(table, (math.inf, 0.0), place)
    unit = stated_unit(table, place, default.unit)
    limits: dict[str, Any] = {"lower": scale * low, "upper": scale * high, "prior_std": scale * std}
    if "prior_mean" in table.data:
        limits["prior_mean"] = scale * mean
    ties.append(dataclasses.replace(read_tie(name, table.data["value"], place, section), unit=unit, **limits))
    return 0.0, dataclasses.replace(default, free=False)


def is_tied(entry: Any) -> bool:
    """Whether an entry of a vehicle file is an expression, alone or as `value` of a table, and no number in quotes."""
    if not isinstance(entry, dict):
        return isinstance(entry, str)
    text = entry.get("value")
    return isinstance(text, str) and not _spells_number(text)


def in_order(ties: tuple[Tie, ...], where: str) -> tuple[Tie, ...]:
    """The `ties` of the file `where`, each behind those that it follows. **Raises** `InputError` for a circle."""
    left, found = {tie.name: tie for tie in ties}, []
    while left:
        ready = [tie for tie in left.values() if not {*tie.names} & {*left}]
        if not ready:
            tie = next(iter(left.values()))
            what = f"{tie.text!r:.60} follows {tie.name} itself, if through others"
            raise InputError(f"{where}: {tie.section}.{tie.name}", what, "give one of them a number")
        found += ready
        left = {name: tie for name, tie in left.items() if tie not in ready}
    return tuple(found)


def followed(ties: tuple[Tie, ...]) -> dict[str, tuple[str, ...]]:
    """By tied number all those that it follows in the end, which follow no others; `ties` are `in_order`."""
    found: dict[str, tuple[str, ...]] = {}
    for tie in ties:
        found[tie.name] = tuple(dict.fromkeys(one for name in tie.names for one in found.get(name, (name,))))
    return found


def tied_rows(
    ties: tuple[Tie, ...], rows: tuple[Parameter, ...], values: Mapping[str, float], where: str
) -> tuple[Parameter, ...]:
    r"""The `rows` of a vehicle's numbers, with what bounds and priors of `ties` say of the numbers that these follow.

    With $\theta_t = a\theta + b$ a bound and a prior of $\theta_t$ are ones of $\theta$; of two Gaussian priors the
    product counts. `values` are all numbers of the file, and `where` is the file. **Raises** `InputError` for an
    expression that has no such form in one free number, and for a value outside of its bounds.
    """
    known, ends = {row.name: row for row in rows}, followed(ties)
    for tie in ties:
        limited = math.isfinite(tie.lower) or math.isfinite(tie.upper) or math.isfinite(tie.prior_std)
        place, value = f"{where}: {tie.section}.{tie.name}", values[tie.name]
        if not tie.lower <= value <= tie.upper:
            what = f"value {value:g} lies outside its bounds [{tie.lower:g}, {tie.upper:g}]"
            raise InputError(place, what, "mend one of them")
        free = [name for name in ends[tie.name] if name in known and known[name].free]
        if not limited or not free:
            continue
        slope = _slope(ties, tie, free[0], values) if len(free) == 1 else 0.0
        if slope == 0.0:
            what = f"has bounds or a prior, and {tie.text!r:.60} is no multiple of one free number, plus a constant"
            raise InputError(place, what, f"give bounds and prior to {' and '.join(free)}")
        known[free[0]] = _limited(known[free[0]], tie, values[free[0]], value, slope)
    return tuple(known[row.name] for row in rows)


def _slope(ties: tuple[Tie, ...], tie: Tie, name: str, values: Mapping[str, float]) -> float:
    """By how much a `tie`, one of `ties`, changes with the number `name`; 0 where it is not linear in that."""
    ends, every = followed(ties), {**values, name: np.polynomial.Polynomial([0.0, 1.0])}
    try:
        for one in ties[: ties.index(tie)]:
            if name in ends[one.name]:
                every[one.name] = one.of(every)
        line = tie.of(every)
    except (ArithmeticError, TypeError, ValueError):
        return 0.0
    coefficients = line.trim().coef if isinstance(line, np.polynomial.Polynomial) else np.zeros(1)
    return float(coefficients[1]) if len(coefficients) == 2 else 0.0


def _limited(row: Parameter, tie: Tie, value: float, tied: float, slope: float) -> Parameter:
    """The row of a number at `value`, under the bounds and the prior of what follows it by `slope`, there at `tied`."""
    back = lambda number: value + (number - tied) / slope
    low, high = sorted((back(tie.lower), back(tie.upper)))
    # the value is within both, up to rounding
    row = dataclasses.replace(row, lower=min(max(row.lower, low), value), upper=max(min(row.upper, high), value))
    if not math.isfinite(tie.prior_std):
        return row
    mean = value if tie.prior_mean is None else back(tie.prior_mean)
    weights = [row.prior_std**-2.0, (abs(slope) / tie.prior_std) ** 2]
    own = row.prior_mean if weights[0] else mean
    return dataclasses.replace(
        row,
        prior_mean=(weights[0] * own + weights[1] * mean) / sum(weights),
        prior_std=tie.prior_std / abs(slope) if not weights[0] else sum(weights) ** -0.5,
    )


def tied_values(ties: tuple[Tie, ...], values: Mapping[str, float], where: str) -> dict[str, float]:
    """The numbers that follow from `values` by `ties` that are `in_order`.

    **Raises** `InputError` for a tie to a number that there is not, and for one without a value.
    """
    found: dict[str, float] = {}
    for tie in ties:
        place = f"{where}: {tie.section}.{tie.name}"
        for name in tie.names:
            if name not in values:
                hint = suggestion(name, values, f"known: {', '.join(values)}")
                raise InputError(place, f"follows {name}, which is no number of the vehicle", hint)
        try:
            value = tie.of({**values, **found})
        except ArithmeticError:
            value = math.nan
        if not isinstance(value, float) or not math.isfinite(value):
            raise InputError(place, f"{tie.text!r:.60} has no finite value", "mend the expression")
        _check_dimension(tie, place)
        found[tie.name] = value
    return found


def _spells_number(text: str) -> bool:
    """Whether a text is a number in quotes, and so no expression."""
    try:
        float(text)
    except ValueError:
        return False
    return True


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
