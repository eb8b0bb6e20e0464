"""A user's model as a vehicle, without a file."""

from typing import Any

from ..errors import InputError
from .own import Model, OwnModel, numbers_of
from .read import vehicle_from


def own_model(model: Model, name: str = "") -> OwnModel:
    """The vehicle of a user's equations, its numbers, inputs and outputs as the `model` has them.

    `name` is that of the class by default. **Raises** `InputError` for a model that cannot be, as `read_vehicle` does.
    """
    kind, title = type(model), name or type(model).__name__
    number = lambda field: {
        "value": _scalar(getattr(model, field), f"{title}.{field}"),
        **kind.parameters.get(field, {}),
    }
    data = {
        "schema": 1,
        "name": title,
        "kind": "model",
        "coefficients": {field.name: number(field.name) for field in numbers_of(kind)},
        "inputs": {one: one for one in kind.inputs},
        "outputs": {key: entry if isinstance(entry, dict) else {"sigma": entry} for key, entry in kind.outputs.items()},
    }
    vehicle = vehicle_from(data, title, model=model)
    assert isinstance(vehicle, OwnModel)
    return vehicle


def _scalar(value: Any, place: str) -> float:
    """A number of a user's model. **Raises** `InputError` for what is none."""
    try:
        return float(value)
    except (TypeError, ValueError) as error:
        remedy = "give one number, or make the field static: eqx.field(static=True)"
        raise InputError(place, f"{value!r:.60} is not a number", remedy) from error
