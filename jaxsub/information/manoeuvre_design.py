r"""Manoeuvre design: the inputs, within limits, whose recording would tell most about the free coefficients.

What is maximised is ln det of the information (D-optimality: the volume of the confidence ellipsoid) over every sample
of every actuator, by L-BFGS. Its gradient is reverse mode through the linearised model itself, whose columns share one
linear recursion: one gradient costs about three linearisations whatever the number of samples and actuators.

Sources: Goodwin and Payne (1977), Dynamic System Identification, ch. 6; Morelli and Klein (1997), J. Aircraft 34(3).
"""

import dataclasses
from collections.abc import Mapping, Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..likelihood import linearise_runs
from ..recording import Recording
from ..recording.runs import Runs
from ..simulation import at_rest, sampled_states
from ..vehicle import AbstractVehicle
from .design_information import Information, information, log_det, require_designable
from .design_limits import Bounds, ManoeuvreLimits, manoeuvre, template
from .design_search import descend, telegraphs

# weight of the squared excess over a channel's limit, and the part of the limit from which it counts
_PENALTY, _MARGIN = 3.0, 0.98
_HALVINGS = 30


@dataclasses.dataclass(frozen=True)
class Design:
    """A designed manoeuvre.

    **Fields**

    - `recording`: its inputs, which a simulation can be driven by; the outputs are blank.
    - `information`: what it would tell.
    - `start`: the name of the manoeuvre that the best search set out from; `history`: ln det less the penalty after
      each of its steps. The history is empty where no search improved on the start.
    """

    recording: Recording
    information: Information
    start: str
    history: list[float]


def design(
    vehicle: AbstractVehicle,
    times: np.ndarray,
    limits: ManoeuvreLimits,
    *,
    starts: Sequence[Recording] = (),
    searches: int = 3,
    steps: int = 100,
    surroundings: Mapping[str, np.ndarray] | None = None,
    seed: int = 0,
) -> Design:
    """The most telling inputs at `times` (K,), s, that keep every limit, for a run that begins `at_rest`.

    Of `starts` and a family of random telegraph signals drawn from `seed`, the best `searches` are improved by at most
    `steps` of L-BFGS each. Limits of channels are penalised in the search; what ends outside one is made smaller until
    it is inside, as the starts are. The design is at least as informative as the best of its starts.

    `surroundings` (K,) are the interpolated columns of a vehicle that has any.

    **Raises** `InputError` as `information` does, for limits that do not fit the vehicle, and for an interpolated
    column that is absent.
    """
    require_designable(vehicle)
    bounds = Bounds.of(vehicle, limits, times)
    columns = surroundings or {}
    family = [(recording.name, recording.inputs(vehicle.layout.held)) for recording in starts]
    family += telegraphs(bounds, seed).items()
    blank = manoeuvre(vehicle, "blank", times, np.zeros_like(bounds.step), columns)
    goal = _Goal(vehicle, template(vehicle, [blank]), at_rest(vehicle, 1), bounds)
    tried = [goal.inside(bounds.follow(jnp.asarray(commands))) for _, commands in family]
    worth = [goal.worth(inputs) for inputs in tried]
    order = np.argsort(worth)[::-1]
    best = order[0]
    found = (worth[best], tried[best], family[best][0], [])
    begin = jnp.stack([bounds.free(tried[index]) for index in order[:searches]])
    ends, losses = descend(_loss, begin, goal, steps)
    gained = -len(vehicle.layout.free) * np.asarray(losses)
    for index, free, history in zip(order, ends, gained, strict=False):
        inputs = goal.inside(bounds.inputs(free))
        if (value := goal.worth(inputs)) > found[0]:
            found = (value, inputs, family[index][0], history[np.isfinite(history)].tolist())
    recording = manoeuvre(vehicle, "design", times, np.asarray(found[1]), columns)
    return Design(recording, information(vehicle, recording), *found[2:])


def keeping(vehicle: AbstractVehicle, recording: Recording, limits: ManoeuvreLimits) -> Recording:
    """`recording` of `vehicle` with its inputs as `limits` allow: commands, then made smaller until every limit holds.

    **Raises** `InputError` as `design` does.
    """
    require_designable(vehicle)
    bounds = Bounds.of(vehicle, limits, recording.times)
    goal = _Goal(vehicle, template(vehicle, [recording]), at_rest(vehicle, 1), bounds)
    inputs = goal.inside(bounds.follow(jnp.asarray(recording.inputs(vehicle.layout.held))))
    return manoeuvre(vehicle, recording.name, recording.times, np.asarray(inputs), recording.columns)


class _Goal(eqx.Module):
    """What the search sees: one run, the held inputs of which are to be found."""

    vehicle: AbstractVehicle
    runs: Runs
    start: Float[Array, "1 s"]
    bounds: Bounds

    def driven(self, inputs: Float[Array, "k m"]) -> Runs:
        rest = self.runs.signals[0, :, inputs.shape[1] :]
        return dataclasses.replace(self.runs, signals=jnp.concatenate([inputs, rest], axis=1)[None])

    def worth(self, inputs: Float[Array, "k m"]) -> float:
        """ln det of the information; minus infinity where the vehicle's answer diverges."""
        value = float(log_det(self.vehicle, linearise_runs(self.vehicle, self.driven(inputs), self.start)))
        return value if np.isfinite(value) else -np.inf

    def loss(self, free: Float[Array, "k m"]) -> Float[Array, ""]:
        """Minus the criterion, per coefficient, and the penalty."""
        runs = self.driven(self.bounds.inputs(free))
        model = linearise_runs(self.vehicle, runs, self.start)
        excess = jnp.abs(self.bounds.used(self.vehicle, model.states[0], runs.signals[0])) - _MARGIN
        penalty = _PENALTY * jnp.sum(jnp.maximum(excess, 0.0) ** 2)
        return penalty - log_det(self.vehicle, model) / model.theta.shape[-1]

    def inside(self, inputs: Float[Array, "k m"]) -> Float[Array, "k m"]:
        """`inputs`, made smaller by one factor where a channel would leave its limit."""

        def keeps(factor: float) -> bool:
            runs = self.driven(factor * inputs)
            states = sampled_states(self.vehicle, runs, self.start)[0]
            # not-a-number keeps nothing
            return bool(jnp.all(jnp.abs(self.bounds.used(self.vehicle, states, runs.signals[0])) <= 1.0))

        if keeps(1.0):
            return inputs
        low, high = 0.0, 1.0
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if keeps(middle) else (low, middle)
        return low * inputs


def _loss(free: Float[Array, "k m"], goal: _Goal) -> Float[Array, ""]:
    return goal.loss(free)
