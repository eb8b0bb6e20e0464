"""Element by element: what each primitive does to numbers, of which some are CasADi's.

An array is one of NumPy's, of numbers where all of them are known and else of objects, each a number or an `SX` of one
element. What is known is computed at once and leaves no trace in the function.
"""

import math
import operator
from collections.abc import Callable
from typing import Any

import casadi
import numpy as np

Scalar = Any
_SX = casadi.SX
_LARGEST = float(np.finfo(np.float64).max)


def is_symbolic(value: Scalar) -> bool:
    """Whether a number is CasADi's and not known."""
    return isinstance(value, _SX)


def known(array: np.ndarray) -> bool:
    """Whether all of an array is."""
    return array.dtype != object


def settled(value: Any) -> np.ndarray:
    """An array, of numbers if all are known by now."""
    array = boxed(value) if is_symbolic(value) else np.asarray(value)
    if known(array) or any(is_symbolic(one) for one in array.flat):
        return array
    return np.array(array.tolist()).reshape(array.shape)


def choose(which: Scalar, yes: Scalar, no: Scalar) -> Scalar:
    """`yes` where `which` is true; of the other not even its NaN is seen."""
    if not is_symbolic(which):
        return yes if which else no
    if not is_symbolic(yes) and not is_symbolic(no) and (yes == no or (yes != yes and no != no)):
        return yes
    return casadi.if_else(which, yes, no)


def _either(symbolic: Callable, numeric: Callable) -> Callable[..., Scalar]:
    """One function on what CasADi knows and on numbers."""
    return lambda *args: symbolic(*args) if any(map(is_symbolic, args)) else numeric(*args)


def _unary(name: str, numeric: Callable) -> Callable[..., Scalar]:
    return _either(getattr(casadi, name), numeric)


def _power(base: Scalar, exponent: Scalar) -> Scalar:
    return base**exponent


def _integer_power(base: Scalar, exponent: int) -> Scalar:
    """By squares, which CasADi shares, and exact where the base is negative."""
    if exponent < 0:
        return 1.0 / _integer_power(base, -exponent)
    if exponent == 0:
        return 1.0
    half = _integer_power(base, exponent // 2)
    square = half * half if exponent > 1 else 1.0
    return square * base if exponent % 2 else square


def _whole(x: Scalar) -> Scalar:
    """Towards zero, as a conversion to integers does."""
    return choose(x < 0, casadi.ceil(x), casadi.floor(x)) if is_symbolic(x) else int(x)


def _nearest(x: Scalar, to_even: bool) -> Scalar:
    """The nearest integer; of two, the even one or that away from zero."""
    floor = casadi.floor if is_symbolic(x) else math.floor
    if not to_even:
        return choose(x < 0, -floor(0.5 - x), floor(x + 0.5))
    up = floor(x + 0.5)
    odd = up - 2.0 * floor(0.5 * up)
    return choose(_and(up - x == 0.5, odd == 1.0), up - 1.0, up)


def _finite(x: Scalar) -> Scalar:
    return casadi.fabs(x) <= _LARGEST if is_symbolic(x) else bool(np.isfinite(x))


_max = _either(casadi.fmax, max)
_min = _either(casadi.fmin, min)
_and = _either(casadi.logic_and, lambda a, b: bool(a) and bool(b))
_or = _either(casadi.logic_or, lambda a, b: bool(a) or bool(b))

ELEMENTWISE: dict[str, Callable[..., Scalar]] = {
    "add": operator.add,
    "add_any": operator.add,
    "sub": operator.sub,
    "mul": operator.mul,
    "div": operator.truediv,
    "neg": operator.neg,
    "abs": _unary("fabs", abs),
    "sign": _unary("sign", np.sign),
    "square": lambda x: x * x,
    "sqrt": _unary("sqrt", np.sqrt),
    "rsqrt": lambda x: 1.0 / ELEMENTWISE["sqrt"](x),
    "cbrt": lambda x: ELEMENTWISE["sign"](x) * ELEMENTWISE["abs"](x) ** (1.0 / 3.0),
    "exp": _unary("exp", np.exp),
    "exp2": lambda x: 2.0**x,
    "expm1": _unary("expm1", np.expm1),
    "log": _unary("log", np.log),
    "log1p": _unary("log1p", np.log1p),
    "sin": _unary("sin", np.sin),
    "cos": _unary("cos", np.cos),
    "tan": _unary("tan", np.tan),
    "asin": _unary("asin", np.arcsin),
    "acos": _unary("acos", np.arccos),
    "atan": _unary("atan", np.arctan),
    "atan2": _either(casadi.atan2, np.arctan2),
    "sinh": _unary("sinh", np.sinh),
    "cosh": _unary("cosh", np.cosh),
    "tanh": _unary("tanh", np.tanh),
    "erf": _unary("erf", math.erf),
    "logistic": lambda x: 1.0 / (1.0 + ELEMENTWISE["exp"](-x)),
    "pow": _power,
    "max": _max,
    "min": _min,
    "rem": _either(casadi.fmod, np.fmod),
    "floor": _unary("floor", np.floor),
    "ceil": _unary("ceil", np.ceil),
    "is_finite": _finite,
    "lt": operator.lt,
    "le": operator.le,
    "gt": operator.gt,
    "ge": operator.ge,
    "eq": operator.eq,
    "ne": operator.ne,
    "and": _and,
    "or": _or,
    "xor": lambda a, b: _and(_or(a, b), ELEMENTWISE["not"](_and(a, b))),
    "not": _either(casadi.logic_not, operator.not_),
    "clamp": lambda low, x, high: _min(_max(x, low), high),
    "copy": lambda x: x,
    "stop_gradient": lambda x: x,
}

# two by two, for reductions and running sums
PAIRWISE: dict[str, Callable[..., Scalar]] = {
    "sum": operator.add,
    "prod": operator.mul,
    "max": _max,
    "min": _min,
    "and": _and,
    "or": _or,
}


def boxed(value: Any) -> np.ndarray:
    """An array of objects; NumPy hands out a single one bare."""
    if isinstance(value, np.ndarray):
        return value.astype(object)
    box = np.empty((), object)
    box[()] = value
    return box


def mapped(call: Callable[..., Scalar], *arrays: Any) -> np.ndarray:
    """`call` on every element of arrays that are alike or of one element."""
    rows = np.broadcast_arrays(*map(boxed, arrays))
    found = np.empty(rows[0].shape, object)
    for place in np.ndindex(*found.shape):
        value = call(*(row[place] for row in rows))
        # NumPy's numbers would take CasADi's for arrays
        found[place] = value.item() if isinstance(value, np.generic) else value
    return found


def integer_power(x: np.ndarray, exponent: int) -> np.ndarray:
    """Of every element."""
    return mapped(lambda value: _integer_power(value, exponent), x)


def rounded(x: np.ndarray, to_even: bool) -> np.ndarray:
    """Every element to an integer."""
    return mapped(lambda value: _nearest(value, to_even), x)


def converted(x: np.ndarray, kind: np.dtype) -> np.ndarray:
    """To another type: truth values and integers are whole numbers among CasADi's."""
    if np.issubdtype(kind, np.bool_):
        return mapped(lambda value: value != 0, x)
    return mapped(_whole, x) if np.issubdtype(kind, np.integer) else x


def selected(which: np.ndarray, cases: list[np.ndarray]) -> np.ndarray:
    """Of every element the case of that number, a truth value being 0 or 1."""
    found = cases[0]
    for number, case in enumerate(cases[1:], 1):
        found = mapped(lambda w, yes, no, n=number: choose(w == n, yes, no), which, case, found)
    return found
