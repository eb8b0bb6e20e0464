"""Which reading shows each sample: of a late sensor a later one.

A reading $z_k = y(t_k - \\tau)$ says of the state at $t_k - \\tau$, and not at $t_k$. So in a filter, and in all that
is linear about its path, it stands at the sample whose state it shows.
"""

import dataclasses

import jax
import numpy as np
from jaxtyping import Int

from ..arrays import Values, namespace
from ..effects import AbstractSensor
from ..recording.runs import Runs
from ..vehicle import AbstractVehicle

# of a sample's interval, within which a reading is taken to be that late
_ROUNDING = 1e-6


def readings_of(vehicle: AbstractVehicle, runs: Runs) -> Int[np.ndarray, "r k c"]:
    """The index of the reading of each channel that shows each sample, at most one interval before it; -1 for none.

    Of sensors that are not late it is the sample's own. Not to be called in `jit`.
    """
    times, channels = np.asarray(runs.times), vehicle.layout.channels
    samples = np.arange(times.shape[1])
    found = np.tile(samples[:, None], (len(times), 1, len(channels)))
    for channel, delay in _delays(vehicle).items():
        for r, own in enumerate(times):
            due = own + delay + _ROUNDING * np.max(np.diff(own), initial=0.0)
            last = np.searchsorted(own, due, side="right") - 1
            # a reading says of one sample alone, and the last ones have none
            first = np.concatenate([[True], last[1:] > last[:-1]])
            found[r, :, channels.index(channel)] = np.where(first, last, -1)
    return found


def as_if_prompt(
    vehicle: AbstractVehicle, runs: Runs, readings: Int[np.ndarray, "r k c"]
) -> tuple[AbstractVehicle, Runs]:
    """A vehicle without sensors that show the past, which a filter does not keep, and `runs` as if it had none.

    Between readings and where they are missing what is shown is interpolated; a sample is measured where the one of the
    `readings` (R, K, c) is that shows it.
    """
    late = _late(vehicle)
    if not late:
        return vehicle, runs
    times, outputs, mask = np.asarray(runs.times), np.array(runs.outputs), np.asarray(runs.mask)
    for effect in late:
        column = vehicle.layout.channels.index(effect.channel)
        plain = jax.tree.map(np.asarray, effect)
        for own, shown, there in zip(times, outputs[..., column], mask[..., column], strict=True):
            if there.any():
                shown[:] = plain.undone(own, np.interp(own, own[there], shown[there]))
        vehicle = vehicle.without_effect(effect.label)
    arrays = jax.device_put({"outputs": outputs, "mask": by_readings(mask, readings)})
    return vehicle, dataclasses.replace(runs, **arrays)


def by_readings(rows: Values, readings: Int[Values, "r k c"]) -> Values:
    """The `rows` (R, K, c, …) of `readings` (R, K, c), each at the sample that it shows; zero where none shows one."""
    xp = namespace(rows, readings)
    wide = readings.reshape(*readings.shape, *[1] * (rows.ndim - 3))
    return xp.where(wide >= 0, xp.take_along_axis(rows, xp.maximum(wide, 0), 1), xp.zeros((), rows.dtype))


def _delays(vehicle: AbstractVehicle) -> dict[str, float]:
    """By channel how late its readings are, s, where they are."""
    found: dict[str, float] = {}
    for effect in _late(vehicle):
        if float(effect.delay) > 0.0:
            found[effect.channel] = found.get(effect.channel, 0.0) + float(effect.delay)
    return found


def _late(vehicle: AbstractVehicle) -> list[AbstractSensor]:
    """Effects on one output each that show the past."""
    own = (effect for effect in vehicle.effects if vehicle.shows(effect) and isinstance(effect, AbstractSensor))
    return [effect for effect in own if effect.remembers]
