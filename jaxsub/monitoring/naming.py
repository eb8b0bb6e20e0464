r"""Which effect of the vocabulary explains what an alarm found, by the rows since it set in.

The columns of a diagnosis (`discrepancy.candidate_columns`), each the sensitivity of the innovations to an effect's
amplitude, are zero until the change sets in. Their products with each other and with the innovations, in one Gram
matrix, give every effect's evidence; the prior of an amplitude is worth one sample (Kass and Wasserman 1995).
"""

import dataclasses
from collections import deque
from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float
from scipy.special import softmax

from ..discrepancy.linearise.columns import candidate_columns
from ..discrepancy.linearise.products import Products
from ..discrepancy.linearise.view import View, facts
from ..effects import AbstractEffect, amplitudes, candidates, parameter_table
from ..estimate import side_by_side
from ..likelihood import Columns, Disturbance, filter_runs, padded_width, total_products
from ..recording import Recording
from ..simulation import Trajectory
from .lines import row_columns
from .setup import WatchedModel

# rows that are kept, and samples since a change at which it is named, and named again
ROWS, NAMED_AT = 1024, (16, 64, 256, 900)
# effects that an event lists
_LISTED = 3
# effects of which the time is a number: at an alarm it is known
_TIMED = "t_0"


class Recent:
    """The last rows (1 + m + c) and the states (s) filtered at them, up to `ROWS` of them."""

    def __init__(self, rows: Sequence[np.ndarray] = (), states: Sequence[np.ndarray] = ()):
        self.rows: deque[np.ndarray] = deque(rows, maxlen=ROWS)
        self.states: deque[np.ndarray] = deque(states, maxlen=ROWS)

    def add(self, row: Float[np.ndarray, " w"], state: Float[np.ndarray, " s"]) -> None:
        """A row that was used, and the state filtered at it."""
        self.rows.append(row)
        self.states.append(state)

    @property
    def full(self) -> bool:
        """Whether there are `ROWS`: with fewer each number would be a program of its own."""
        return len(self.rows) == ROWS

    def since(self, time: float) -> int:
        """How many of the rows are later than a `time`, s."""
        return sum(bool(row[0] > time) for row in self.rows)


def named_effects(model: WatchedModel, recent: Recent, since: float) -> list[dict[str, Any]]:
    """The effects that explain best what set in at the time `since` (s) of `recent` rows of the vehicle of `model`.

    Each has its `effect`, `where`, `probability` among all effects and none, and the values of its `parameters`.
    """
    view = _view(model, np.stack(recent.rows), np.asarray(recent.states[0]))
    effects = [effect for effect in candidates(facts(view)) if _TIMED not in parameter_table(effect)]
    columns, owners = candidate_columns(view, effects)
    late = np.stack(recent.rows)[:, 0] >= since
    products, length = _products(view, columns.dense(), np.pad(late, (0, view.runs.times.shape[1] - len(late))))
    gains = products.gains([], owners)
    probability = softmax([0.0, *np.nan_to_num(gains.evidence, nan=-np.inf)])[1:]
    order = np.argsort(-probability)[:_LISTED]
    return [_shown(effects[i], float(probability[i]), gains.amplitudes[i] / length[owners[i]]) for i in order]


def _shown(effect: AbstractEffect, probability: float, sizes: np.ndarray) -> dict[str, Any]:
    names = amplitudes(effect)
    values = dict(zip(names, map(float, sizes), strict=False)) if names else {}
    return {
        "effect": effect.name,
        "label": effect.label,
        "where": list(effect.where),
        "probability": probability,
        "parameters": values,
    }


def _view(model: WatchedModel, rows: Float[np.ndarray, "k w"], x: Float[np.ndarray, " s"]) -> View:
    """The vehicle's view of `rows` (K, w) from the state `x` (s,) at the first of them."""
    layout, disturbance = model.vehicle.layout, _forces(model)
    names = row_columns(layout)
    signals = len(layout.held) + len(layout.interpolated)
    table = np.where(np.isinf(rows), np.nan, rows)
    # an input that is missing is the last one
    for column in table[:, 1 : 1 + signals].T:
        there = np.isfinite(column)
        column[:] = column[np.maximum.accumulate(np.where(there, np.arange(len(column)), 0))]
    np.nan_to_num(table[:, 1 : 1 + signals], copy=False)
    recording = Recording("watched", table[:, 0], dict(zip(names, table[:, 1:].T, strict=True)), "watched")
    runs = dataclasses.replace(side_by_side(model.vehicle, [recording]), substeps=model.substeps).padded()
    sigma, start = jnp.asarray(model.sigma), jnp.asarray(x)[None]
    std = jnp.asarray(model.sigma.min() * np.ones(len(x)))
    followed = filter_runs(model.vehicle, runs, sigma, disturbance, start, std)
    path = Trajectory.of(model.vehicle, runs, followed.expected, followed.filtered)
    base = jax.tree.map(np.asarray, followed.residual)
    none = np.zeros((0, 0))
    return View(model.vehicle, none, runs, sigma, followed, disturbance, path, base, np.zeros((1, 1)), np.zeros(0))


def _forces(model: WatchedModel) -> Disturbance:
    """The disturbance of a model, white noise of its velocities as forces that last for an interval."""
    n = len(model.vehicle.layout.equations)
    inertia = np.diag(np.asarray(model.vehicle.mass_matrix()))
    white = inertia * model.density[:n] / np.sqrt(2.0 * model.interval)
    force = np.asarray(model.disturbance.force)
    time = np.where(force > 0.0, np.asarray(model.disturbance.time), model.interval)
    return Disturbance(np.where(force > 0.0, force, white), time, np.asarray(model.disturbance.noise))


def _products(view: View, columns: Columns, late: Bool[np.ndarray, " k"]) -> tuple[Products, Float[np.ndarray, " q"]]:
    """Products of the residual and of columns that are zero but where it is `late` (K,), and the columns' lengths."""
    system, count = view.followed.system, columns.shown.shape[-1]
    assert columns.forcing is not None
    after = Columns(
        np.where(late[None, :, None, None], columns.shown, 0.0),
        np.where(late[None, :-1, None, None], columns.forcing, 0.0),
    )
    whole = (view.base + after).padded(padded_width(1 + count))
    gram, log_determinant = total_products(view.disturbance, system, whole)
    samples = int(np.sum(np.asarray(system.measured) & late[None, :, None]))
    found = np.asarray(gram)[: 1 + count, : 1 + count]
    # of unit length, as the prior that is worth one sample wants them
    length = np.sqrt(np.maximum(np.diag(found), 1e-300))
    length[0] = 1.0
    length[1:] = np.where(np.diag(found)[1:] > 0.0, length[1:], 1.0)
    return Products(view.disturbance, found / np.outer(length, length), float(log_determinant), samples, 1), length[1:]
