"""The solution of a fit on disk: where its search ended and the recordings, from which its statistics follow again."""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np

from ..effects import AbstractEffect
from ..estimate import SearchEnd, Solution, batch, evaluate
from ..recording import Recording
from ..results import OUTCOMES, RESULTS, outcome_numbers
from ..vehicle import read_vehicle, write_vehicle
from .stored import Stored, store, stored

FITTED, _KIND = "fitted.toml", "Fit"
_ARRAYS = ("start", "sigma", "cost", "steps")


def store_solution(
    found: Solution, comment: str, folder: Path, text: Mapping[str, Any], recordings: Sequence[Recording]
) -> None:
    """Write `fitted.toml`, which begins with the `comment`, and with `recordings` also `result.npz` into `folder`.

    `text` is what else there is to store of the fit, as JSON has it.
    """
    write_vehicle(found.vehicle, folder / FITTED, comment)
    if not recordings:
        return
    search = {
        "outcome": _outcome(found.result),
        "substeps": found.runs.substeps,
        "known_start": found.known_start,
        "estimated_spreads": found.estimated_spreads,
    }
    arrays = {name: np.asarray(getattr(found, name)) for name in _ARRAYS}
    store(folder, _KIND, {**text, "search": search}, arrays, recordings)


def stored_solution(folder: Path, effects: Sequence[type[AbstractEffect]]) -> tuple[Solution, Stored]:
    """What `store_solution` wrote into `folder`, with `effects` of a user's own that the vehicle may have.

    **Raises** `InputError` where there is no such result.
    """
    kept = stored(folder, _KIND)
    search, vehicle = kept.text["search"], read_vehicle(folder / FITTED, effects)
    runs = dataclasses.replace(batch(vehicle, kept.recordings).padded(), substeps=search["substeps"])
    start, sigma, cost, steps = (jnp.asarray(kept.arrays[name]) for name in _ARRAYS)
    end = SearchEnd(
        vehicle,
        runs,
        start,
        sigma,
        cost,
        steps,
        getattr(RESULTS, search["outcome"]),
        known_start=search["known_start"],
        estimated_spreads=tuple(search["estimated_spreads"]),
    )
    return evaluate(end), kept


def _outcome(result: RESULTS) -> str:
    """The name of a result; a rare one of the optimiser's is a divergence."""
    name = OUTCOMES[int(outcome_numbers(result))]
    return "nonlinear_divergence" if name == OUTCOMES[-1] else name
