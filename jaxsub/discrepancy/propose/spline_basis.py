"""Nonparametric forces of one variable, in linear splines, and which variables predict the missing force.

A missing force appears as a disturbance in a filter. The variable that it is a function of predicts it, in one part of
the recordings by the others.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from ...effects import KNOTS, SmoothForce, variables
from .. import settings
from ..linearise.view import View

# positions, of which no force is a function
_LEFT_OUT = ("x", "y")
# standard deviation, SI, below which what a variable does is rounding
STILL = 1e-9
# knots of the regression that picks a force
_CHOOSING = 2 * (KNOTS - 1) + 1


def smooth_forces(view: View) -> list[SmoothForce]:
    """Every equation with every variable that moves."""
    starts, ends = variables(view.path.start), variables(view.path.end)
    live = view.path.steps > 0.0
    found = []
    for name in starts:
        x = np.broadcast_to(np.asarray(starts[name]), live.shape)[live]
        if name in _LEFT_OUT or name not in ends or not np.std(x) > STILL:
            continue
        low, high = (float(f"{edge:.6g}") for edge in np.percentile(x, [1.0, 99.0]))
        if high > low:
            found += [SmoothForce(e, name, low, high) for e in view.vehicle.layout.equations]
    return found


def promising_forces(view: View, forces: Sequence[SmoothForce], missing: np.ndarray) -> list[list[SmoothForce]]:
    """Of each equation's forces those that predict most of the `missing` force (R, K, n), the best first.

    They predict blocks of it by the others (cross-validation).
    """
    equations = view.vehicle.layout.equations
    shares = {
        force.variable: _predicted_share(view, force, missing) for force in forces if force.equation == equations[0]
    }
    ranked = []
    for place, equation in enumerate(equations):
        own = [force for force in forces if force.equation == equation]
        own.sort(key=lambda force, place=place: -shares[force.variable][place])
        ranked.append(own[: 1 + settings.ALTERNATIVES])
    return ranked


def _predicted_share(view: View, force: SmoothForce, missing: np.ndarray) -> np.ndarray:
    """(n,) share of each equation's missing force that the variable predicts in blocks by the other blocks."""
    drawn, live = hat_functions(_place(view, force)[0], _CHOOSING), view.path.steps > 0.0
    pieces = [
        (r, piece) for r, there in enumerate(live) for piece in np.array_split(np.flatnonzero(there), settings.BLOCKS)
    ]
    H, y = [drawn[r, piece] for r, piece in pieces], [missing[r, piece] for r, piece in pieces]
    G = np.array([h.T @ h for h in H])
    b, squares = np.array([h.T @ v for h, v in zip(H, y, strict=True)]), np.array([np.sum(v**2, axis=0) for v in y])
    # the prior of each height is worth one sample
    others = G.sum(axis=0) - G + np.eye(_CHOOSING)
    w = np.linalg.solve(others, b.sum(axis=0) - b)
    left = squares - 2.0 * np.sum(w * b, axis=1) + np.sum(w * (G @ w), axis=1)
    return 1.0 - left.sum(axis=0) / np.maximum(squares.sum(axis=0), 1e-300)


def basis_forces(view: View, force: SmoothForce, knots: int) -> Iterator[np.ndarray]:
    """The force of each hat function at both ends of each interval, (2, R, K-1, n)."""
    equations = view.vehicle.layout.equations
    own = np.eye(len(equations))[equations.index(force.equation)]
    drawn = hat_functions(_place(view, force), knots)
    return (drawn[..., j, None] * own for j in range(knots))


def hat_functions(place: np.ndarray, knots: int) -> np.ndarray:
    """(..., knots) hat functions at equidistant knots, `place` being 0 at the first and 1 at the last."""
    return np.maximum(0.0, 1.0 - np.abs(place[..., None] * (knots - 1) - np.arange(knots)))


def _place(view: View, force: SmoothForce) -> np.ndarray:
    """(2, R, K-1) the variable at both ends of each interval, from 0 to 1 of its range."""
    shape = view.path.steps.shape
    ends = [np.broadcast_to(np.asarray(variables(m)[force.variable]), shape) for m in (view.path.start, view.path.end)]
    return np.clip((np.stack(ends) - force.low) / (force.high - force.low), 0.0, 1.0)
