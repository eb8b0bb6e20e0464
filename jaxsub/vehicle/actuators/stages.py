"""What stands between a command and its actuator, as keys of `[actuators.NAME]`, and the effects that they are."""

from collections.abc import Iterable, Sequence

from ...effects import (
    AbstractActuator,
    AbstractEffect,
    ActuatorDelay,
    ActuatorLag,
    ActuatorRateLimit,
    number_fields,
    parameter_table,
)
from ...errors import InputError
from ...parameters import Parameter
from ..schema import Table
from ..ties import Tie, is_tied, read_entry
from .base import Actuator

# in the order in which a command passes them
STAGES: dict[str, type[AbstractActuator]] = {
    "delay": ActuatorDelay,
    "rate_limit": ActuatorRateLimit,
    "time_constant": ActuatorLag,
}


def read_stages(
    table: Table, actuator: Actuator, unit: str, ties: list[Tie]
) -> list[tuple[AbstractActuator, Parameter]]:
    """The stages of an actuator whose input has the SI `unit`, each with the row of its one number.

    A number that follows others is added to `ties`, by the name `NAME.key`.
    """
    found = []
    for key, kind in STAGES.items():
        if key not in table.data:
            continue
        if len(actuator.input) != 1:
            what = f"acts on a command of {len(actuator.input)} inputs"
            remedy = f'give each of them [[effects]] effect = "{kind.name}"'
            raise InputError(table.place(key), what, remedy)
        ((name, _),) = actuator.input
        (field,) = (one.name for one in number_fields(kind))
        row = parameter_table(kind(actuator=name))[field]
        per = {"rate_limit": unit and f"({unit})/s"}.get(key, "s")
        row = Parameter(row.name, per, free=False, lower=row.lower)
        entry, place = table.data[key], table.place(key)
        value, row = read_entry(f"{actuator.name}.{key}", entry, place, row, "actuators", ties)
        if is_tied(entry):
            found.append((kind(actuator=name), row))
            continue
        if value <= 0.0:
            raise InputError(place, f"is {value:g}", "give a positive number")
        found.append((kind(actuator=name, **{field: value}), row))
    return found


def stages_of(actuator: Actuator, effects: Sequence[AbstractEffect]) -> dict[str, AbstractActuator]:
    """Those of `effects` that keys of the actuator's table say, by key.

    They act on its one input before all others, in the order of `STAGES`.
    """
    keys, found = {kind: key for key, kind in STAGES.items()}, {}
    order = list(STAGES)
    for effect in effects:
        if not isinstance(effect, AbstractActuator) or [effect.actuator] != [name for name, _ in actuator.input]:
            continue
        key = keys.get(type(effect))
        if key is None or any(order.index(key) <= order.index(other) for other in found):
            break
        found[key] = effect
    return found


def stage_numbers(actuators: Iterable[Actuator], effects: Sequence[AbstractEffect]) -> dict[str, str]:
    """Of the number of each stage, by the name `NAME.key` that expressions have for it, its name in the vehicle."""
    found: dict[str, str] = {}
    for item in actuators:
        for key, effect in stages_of(item, effects).items():
            (row,) = parameter_table(effect).values()
            found[f"{item.name}.{key}"] = row.name
    return found
