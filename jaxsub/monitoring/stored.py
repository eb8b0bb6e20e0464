"""A watcher's state in a file, so that it goes on after its process has ended."""

import dataclasses
import hashlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..likelihood import Disturbance
from ..storage import opened_archive, write_archive, written_whole
from ..vehicle import AbstractVehicle, vehicle_text
from .setup import WatchedModel

_KEY, _SCHEMA = "watch", 1
_REMEDY = "remove it to begin anew"


@dataclasses.dataclass(frozen=True)
class Stored:
    """What a file of state holds.

    **Fields**

    - `model`: as the watcher's. `numbers`: by name, whatever JSON takes. `arrays`: of the filter and the test.
    """

    model: WatchedModel
    numbers: dict[str, Any]
    arrays: Sequence[np.ndarray]


def write_stored(path: Path, stored: Stored) -> None:
    """Write `stored` to `path` in one step: after a power cut there is the old file or the new one.

    **Raises** `OSError` where it cannot be written.
    """
    model, d = stored.model, stored.model.disturbance
    own = {"substeps": model.substeps, "interval": model.interval, "longest": model.longest}
    text = json.dumps({"schema": _SCHEMA, "vehicle": _digest(model.vehicle), "model": own, "numbers": stored.numbers})
    known = {"sigma": model.sigma, "density": model.density, "start_std": model.start_std}
    known |= {name: np.asarray(values) for name, values in vars(d).items()}
    arrays = {f"array{i}": one for i, one in enumerate(stored.arrays)}
    with written_whole(path) as beside:
        write_archive(beside, _KEY, text, known | arrays)


def read_stored(path: Path, vehicle: AbstractVehicle) -> Stored:
    """What `write_stored` wrote to `path` of a watcher of `vehicle`.

    **Raises** `InputError` for a file that is no such state, is damaged or is of another vehicle.
    """
    known = vehicle.holding(vehicle.values())
    with opened_archive(path, _KEY, "is no state of jaxsub watch, or damaged", _REMEDY) as (content, arrays):
        if content["schema"] != _SCHEMA:
            raise InputError(str(path), f"has schema {content['schema']}, not {_SCHEMA}", _REMEDY)
        if content["vehicle"] != _digest(known):
            raise InputError(str(path), f"is of another vehicle than {vehicle.layout.name}", _REMEDY)
        count = sum(name.startswith("array") for name in arrays)
        disturbance = Disturbance(arrays["force"], arrays["time"], arrays["noise"])
        own = {name: arrays[name] for name in ("sigma", "density", "start_std")}
        model = WatchedModel(vehicle=known, disturbance=disturbance, **own, **content["model"])
        return Stored(model, content["numbers"], [arrays[f"array{i}"] for i in range(count)])


def _digest(vehicle: AbstractVehicle) -> str:
    return hashlib.sha256(vehicle_text(vehicle).encode()).hexdigest()
