"""Columns of sensor effects on motions that the vehicle file prescribes: what they change of each step, and show."""

from collections.abc import Sequence
from typing import TypeGuard

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ...arrays import Values, quietly
from ...effects import AbstractEffect, AbstractSensor, amplitudes, by_name, with_numbers
from ...likelihood import by_share, forces_at_ends, jacobians, joined, share_of
from ...recording.runs import Runs
from ...vehicle import AbstractVehicle
from .view import View


def on_prescribed(effect: AbstractEffect, vehicle: AbstractVehicle) -> TypeGuard[AbstractSensor]:
    """Whether an effect is of a sensor by whose recording the `vehicle` moves."""
    return isinstance(effect, AbstractSensor) and not vehicle.shows(effect)


@quietly
def prescribed_slopes(
    view: View, effects: Sequence[AbstractEffect]
) -> list[tuple[Float[np.ndarray, "r k1 s"], Float[np.ndarray, "r k c"]]]:
    """What the amplitude of each effect changes of the step to the next sample, and of the channels, SI.

    Of effects that have one amplitude. Attitude enters forces, and how positions move, and what is shown: so these are
    Jacobians of the vehicle that has the effects, at zero.
    """
    if not effects:
        return []
    vehicle = view.vehicle.holding(view.vehicle.values())
    for effect in effects:
        effect = with_numbers(effect, dict.fromkeys(amplitudes(effect), 0.0))
        vehicle = vehicle.without_effect(effect.label).with_effect(effect)
    followed, runs = view.followed, view.runs
    push = forces_at_ends(np.asarray(followed.force), view.path.steps, np.asarray(view.disturbance.time))
    along = (followed.filtered, followed.expected, push)
    own = lambda some: (vehicle, runs.share(some), *share_of(along, some))
    step, shown = map(np.asarray, joined(by_share(_of_share, own, *runs.times.shape), len(runs.times)))
    return [(step[..., i], shown[..., i]) for i in range(len(effects))]


def prescribed_change(view: View, effect: AbstractSensor) -> tuple[Float[np.ndarray, "r k"], Float[np.ndarray, "r k"]]:
    """What an effect makes of the motion that it is on, less that motion, and the motion as recorded, SI."""
    recorded = np.asarray(by_name(view.path.seen)[effect.channel])
    plain = jax.tree.map(np.asarray, effect)
    return np.asarray(plain.undone(view.path.times, recorded)) - recorded, recorded


def _of_share(
    vehicle: AbstractVehicle, runs: Runs, filtered: Values, expected: Values, push: Values
) -> tuple[np.ndarray, np.ndarray]:
    by = jacobians(vehicle, runs, *map(jnp.asarray, (filtered, expected, push)))
    return np.asarray(by.F), np.asarray(by.direct)
