"""A vehicle in a few lines of text: what it is, what is free, and its numbers with units."""

import math
import textwrap
from typing import Any

from ..parameters import Parameter
from .layout import Layout

_WIDTH, _MOST_FIXED = 120, 40


def described(layout: Layout, values: dict[str, Any]) -> str:
    """The vehicle of that `layout` with the numbers `values`, SI: free ones a line each, fixed ones in a paragraph.

    Of numbers with axes, as under `jax.vmap` and `jax.jit`, it says their shape.
    """
    free = [f"  {_number(row, values)}{_limits(row)}" for row in layout.free]
    nonzero = [_number(row, values) for row in layout.parameters if not row.free and not _is_zero(values[row.name])]
    more = [f"{len(nonzero) - _MOST_FIXED} more"] if len(nonzero) > _MOST_FIXED else []
    fixed = ", ".join([*nonzero[:_MOST_FIXED], *more]) or "nothing but zeros"
    pairs = lambda named: ", ".join(name if name == column else f"{name} = {column}" for name, column in named)
    signals = pairs((*layout.inputs, *layout.prescribed, *layout.environment))
    paragraphs = [
        f"{layout.name}: {layout.kind} with {', '.join(layout.equations)}",
        f"inputs: {signals or 'none'}",
        f"outputs: {', '.join(map(layout.noise, layout.outputs)) or 'none'}",
        f"free ({len(free)}):" if free else "free: nothing",
        *free,
        f"fixed: {fixed}",
    ]
    wrapped = lambda text: textwrap.wrap(text, _WIDTH, subsequent_indent="    ", drop_whitespace=True)
    return "\n".join(line for paragraph in paragraphs for line in wrapped(paragraph))


def _number(row: Parameter, values: dict[str, Any]) -> str:
    return f"{row.name} = {_text(values[row.name])} {row.unit}".rstrip()


def _text(value: Any) -> str:
    try:
        return f"{float(value):.6g}"
    except (TypeError, ValueError):  # a tracer, or one number for each of many vehicles
        return f"{value.dtype}[{','.join(map(str, value.shape))}]"


def _is_zero(value: Any) -> bool:
    return _text(value) == "0"


def _limits(row: Parameter) -> str:
    bounded = math.isfinite(row.lower) or math.isfinite(row.upper)
    within = f", within {row.lower:.6g} to {row.upper:.6g}" if bounded else ""
    known = f", prior {row.prior_mean:.6g} ± {row.prior_std:.2g}" if math.isfinite(row.prior_std) else ""
    return within + known + (", differs by run" if row.varies else "")
