"""Arithmetic on one channel of a log, such as `(x - 1500) * 0.001` or `-90 - yaw(q)`: scaled and shifted, no more."""

import ast
import math
import re
from typing import NamedTuple

FUNCTIONS = ("roll", "pitch", "yaw", "unwrap")
_LONGEST = 300
_NUMBER = re.compile(r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?(?=[\s*()]|$)", re.ASCII)
_CALL = re.compile(rf"(?P<function>{'|'.join(FUNCTIONS)})\((?P<channel>[^()]+)\)")
_CHANNEL = re.compile(r"[^\s*()]+(?:\([^()\s]*\))?")
_BEFORE = re.compile(r"[-+(]")
_OPERATOR = re.compile(r"[-+*/)]")


class Term(NamedTuple):
    """`factor * function(channel) + offset`; `function` may be empty."""

    factor: float
    function: str
    channel: str
    offset: float = 0.0


def parse_term(text: str) -> Term:
    """The term that `text` writes. Raises ValueError, saying why, for any other than a line in one channel.

    A channel's name may hold dots, slashes, brackets and dashes; so `+`, `-` and `/` are operators only after a blank
    or a parenthesis.
    """
    if len(text) > _LONGEST:
        raise ValueError(f"is longer than {_LONGEST} characters")
    expression, channels = _tokens(text.strip())
    if len(channels) != 1:
        listed = " and ".join(sorted(f"{function}({name})" if function else name for function, name in channels))
        raise ValueError(f"takes {listed}, and a column comes from one channel" if channels else "names no channel")
    try:
        factor, offset = _line(ast.parse(expression, mode="eval").body)
    except (SyntaxError, RecursionError, MemoryError) as error:
        raise ValueError("is no arithmetic") from error
    if not (math.isfinite(factor) and math.isfinite(offset)) or factor == 0.0:
        raise ValueError(f"is {factor:g} times its channel plus {offset:g}")
    function, channel = channels.pop()
    return Term(factor, function, channel, offset + 0.0)


def _tokens(text: str) -> tuple[str, set[tuple[str, str]]]:
    """The text with `x` for each channel, and the channels with their functions."""
    out, channels, place, operand = [], set(), 0, True
    while place < len(text):
        if text[place].isspace():
            place += 1
            continue
        if not operand and (found := _OPERATOR.match(text, place)):
            out.append(found[0])
            operand = found[0] != ")"
        elif operand and (found := _BEFORE.match(text, place)):
            out.append(found[0])
        elif operand and (found := _NUMBER.match(text, place)):
            out.append(found[0])
            operand = False
        elif operand and (found := _CALL.match(text, place)):
            channels.add((found["function"], found["channel"].strip()))
            out.append("x")
            operand = False
        elif operand and (found := _CHANNEL.match(text, place)):
            channels.add(("", found[0]))
            out.append("x")
            operand = False
        else:
            raise ValueError(f"cannot be read from {text[place:][:20]!r} on")
        place = found.end()
    return " ".join(out), channels


def _line(node: ast.expr) -> tuple[float, float]:
    """Factor and offset of an expression in `x`."""
    match node:
        case ast.Name():
            return 1.0, 0.0
        case ast.Constant(value=int() | float() as value):
            return 0.0, float(value)
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            factor, offset = _line(operand)
            return -factor, -offset
        case ast.UnaryOp(op=ast.UAdd(), operand=operand):
            return _line(operand)
        case ast.BinOp(left=left, op=ast.Add() | ast.Sub() | ast.Mult() | ast.Div() as op, right=right):
            return _combined(_line(left), op, _line(right))
    raise ValueError("is no arithmetic")


def _combined(left: tuple[float, float], op: ast.operator, right: tuple[float, float]) -> tuple[float, float]:
    (a, b), (c, d) = left, right
    if isinstance(op, ast.Add | ast.Sub):
        sign = 1.0 if isinstance(op, ast.Add) else -1.0
        return a + sign * c, b + sign * d
    if isinstance(op, ast.Div):
        if c or not d:
            raise ValueError("divides by its channel" if c else "divides by zero")
        return a / d, b / d
    if a and c:
        raise ValueError("multiplies its channel by itself")
    return a * d + b * c, b * d
