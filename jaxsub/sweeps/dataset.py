"""A sweep's folder as one labelled dataset, finished or not."""

from pathlib import Path

import numpy as np
import xarray

from ..errors import InputError
from ..results import OUTCOMES
from .description import name_of
from .store import chunk_files, kept_plan, read_chunk

AXES = ("vehicle", "recording", "noise", "start")
AS_RECORDED, MISSING = -1, -1
_SAID = {
    "initial_guess": "where the search started",
    "estimate": "where it ended",
    "standard_error": "standard error of the estimate, initial states' uncertainty included",
    "coordinates": "where it ended, in the search's own coordinates, which Problem.split takes",
    "cost": "½ Σ whitened residuals², priors included",
    "away": "how many standard errors the optimum may still be away",
    "evaluations": "evaluations of the cost, with whichever derivatives the method takes along; -1 where not done",
}


def open_sweep(folder: str | Path) -> xarray.Dataset:
    """What is done of the sweep in `folder`, over (vehicle, recording, noise, start).

    Coefficients are labelled by name and have their `unit` beside them. `done` is false, `outcome` is -1 and numbers
    are NaN where a search has not been done yet; `outcome` is a number whose meaning its attribute `flag_meanings` has.
    The coordinate of `noise` is its seed, or -1 for recordings taken as they are.

    **Raises** `InputError` where `folder` holds no sweep.
    """
    folder = Path(folder)
    kept = kept_plan(folder)
    if kept is None:
        raise InputError(str(folder), "holds no sweep", "give the --out of a sweep")
    plan, shape = kept["plan"], kept["layout"]
    noise = plan["noise"] or [AS_RECORDED]
    per_case, names = len(noise) * plan["starts"], list(shape["coefficients"])
    vehicles, recordings = list(plan["vehicles"]), list(plan["recordings"])
    flat = _blank(len(vehicles) * len(recordings) * per_case, len(names), max(shape["coordinates"]))
    for path in chunk_files(folder):
        read = read_chunk(path, name_of(plan))
        if read is None:
            continue
        chunk, answers = read
        rows = slice(chunk.case * per_case + chunk.first, chunk.case * per_case + chunk.last)
        columns = [names.index(name) for name in shape["free"][chunk.case]]
        for name, values in answers.items():
            held = flat["initial_guess" if name == "start" else name]
            if name in ("start", "estimate", "standard_error"):
                held[rows, columns] = values
            elif values.ndim == 2:
                held[rows, : values.shape[1]] = values
            else:
                held[rows] = values
    sizes = (len(vehicles), len(recordings), len(noise), plan["starts"])
    dataset = xarray.Dataset(
        {name: (_dims(name, held), held.reshape(*sizes, *held.shape[1:])) for name, held in flat.items()},
        {"vehicle": vehicles, "recording": recordings, "noise": noise, "start": np.arange(plan["starts"])},
        {"plan": name_of(plan), **{key: plan[key] for key in ("spread", "seed", "method", "precision")}},
    )
    values = [[shape["file_values"][vehicle].get(name, np.nan) for name in names] for vehicle in vehicles]
    dataset = dataset.assign_coords(coefficient=names, unit=("coefficient", list(shape["coefficients"].values())))
    dataset["file_value"] = (("vehicle", "coefficient"), np.array(values).reshape(len(vehicles), len(names)))
    dataset["done"] = dataset.outcome != MISSING
    dataset.outcome.attrs = {"flag_values": list(range(len(OUTCOMES))), "flag_meanings": " ".join(OUTCOMES)}
    for name, said in _SAID.items():
        dataset[name].attrs["long_name"] = said
    return dataset


def _blank(cells: int, coefficients: int, coordinates: int) -> dict[str, np.ndarray]:
    """Every variable over all searches, none of them done."""
    nothing = lambda *shape: np.full((cells, *shape), np.nan)
    numbers = {name: nothing(coefficients) for name in ("initial_guess", "estimate", "standard_error")}
    numbers |= {"coordinates": nothing(coordinates), "cost": nothing(), "away": nothing()}
    return numbers | {"evaluations": np.full(cells, -1), "outcome": np.full(cells, MISSING, np.int8)}


def _dims(name: str, held: np.ndarray) -> tuple[str, ...]:
    last = "coordinate" if name == "coordinates" else "coefficient"
    return (*AXES, *((last,) if held.ndim == 2 else ()))
