"""C of a CasADi function that works out several arguments side by side, one in each lane of a vector register.

A model of twelve states has too little arithmetic for a program of array operations: starting them, and multiplying by
their zeros, takes most of the time. Element by element, with the zeros gone, a processor does as many members of a
batch at once as its registers hold.
"""

from pathlib import Path

import casadi

from ..errors import InputError

HEADER = Path(__file__).with_name("lanes.h")

_WORDS = {
    "ASSIGN": "{0}",
    "ADD": "{0} + {1}",
    "SUB": "{0} - {1}",
    "MUL": "{0} * {1}",
    "DIV": "{0} / {1}",
    "NEG": "-{0}",
    "SQ": "{0} * {0}",
    "TWICE": "{0} + {0}",
    "INV": "1.0 / {0}",
    "CONSTPOW": "v_pow({0}, {1})",
    "IF_ELSE_ZERO": "v_if({0}, {1})",
}
_ONE = "sqrt sin cos tan asin acos atan sinh cosh tanh exp expm1 log log1p erf fabs floor ceil sign not"
_TWO = "pow atan2 fmod fmin fmax copysign lt le eq ne and or"
_WORDS |= {name.upper(): f"v_{name}({{0}})" for name in _ONE.split()}
_WORDS |= {name.upper(): f"v_{name}({{0}}, {{1}})" for name in _TWO.split()}
_NUMBER = {getattr(casadi, f"OP_{word}"): text for word, text in _WORDS.items() if hasattr(casadi, f"OP_{word}")}
_NAME = {getattr(casadi, name): name.removeprefix("OP_").lower() for name in dir(casadi) if name.startswith("OP_")}


def lanes_c(function: "casadi.Function") -> str:
    """`function` as `static void NAME(const V *i0, …, V *o0, …)`, to stand after lanes.h.

    Arguments and results hold the nonzeros of each matrix, by columns, LANES members side by side.

    **Raises** `InputError` for an operation that lanes.h does not have, by name.
    """
    given = [f"const V *restrict i{i}" for i in range(function.n_in())]
    found = [f"V *restrict o{i}" for i in range(function.n_out())]
    lines, version = [], {}
    held = lambda place: f"w{place}_{version[place]}"
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        to, of = function.instruction_output(k), function.instruction_input(k)
        if operation == casadi.OP_OUTPUT:
            lines.append(f"o{to[0]}[{to[1]}] = {held(of[0])};")
            continue
        if operation == casadi.OP_INPUT:
            text = f"i{of[0]}[{of[1]}]"
        elif operation == casadi.OP_CONST:
            text = f"v_same({function.instruction_constant(k)!r})"
        elif operation in _NUMBER:
            text = _NUMBER[operation].format(*map(held, of))
        else:
            name = _NAME.get(operation, str(operation))
            raise InputError(name, "is an operation that has no form in lanes", "leave the compiled march out")
        # a place in CasADi's memory is written many times; a name once, which is what compilers like best
        version[to[0]] = version.get(to[0], -1) + 1
        lines.append(f"const V {held(to[0])} = {text};")
    body = "\n    ".join(lines)
    return f"static void {function.name()}({', '.join([*given, *found])}) {{\n    {body}\n}}\n"
