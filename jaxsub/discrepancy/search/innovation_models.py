"""Models estimated by innovations alone: of unstable vehicles, or ones that lack many effects at once.

The simulation of an unstable vehicle, as most are that an autopilot steers, diverges within seconds whatever the model.
A filter follows the measurements, and parameters by its innovations approach the truth one effect after the other. The
result is accepted if simulations, re-initialised as often as the model needs it, are better with all of it.
"""

import dataclasses
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np

from ...effects import AbstractEffect, RunVariation
from ...estimate import SearchEnd, continued, evaluate, substeps_for
from ...likelihood import Disturbance, concentrated_sigma, residual_outputs
from ...results import SUCCESSFUL
from ...vehicle import AbstractVehicle
from .. import settings
from ..accept.acceptance import Model, ModelFitter, fitted_model
from ..accept.cross_validation import Comparison, compare, one_step_ahead, simulated
from ..accept.model import amplitude_indices, with_scaled_effects, without_variation
from ..accept.restarts import restarted, starts
from ..linearise.evidence import evidence_of
from ..linearise.view import View, led_from, look
from ..programs import make_room
from ..propose.selector import Selector


@dataclasses.dataclass(frozen=True)
class InnovationModels:
    """Models with parameters estimated by innovations, compared by one-step-ahead prediction.

    Their simulation errors are taken to be those of the model that they start from.
    """

    fitter: ModelFitter

    def begin(self, model: Model) -> Model:
        """A model with the parameters of its view."""
        return self._model(model, model.view, ())

    def with_effects(
        self,
        model: Model,
        effects: Sequence[AbstractEffect],
        disturbance: Disturbance,
        near: Sequence[AbstractVehicle] = (),
    ) -> Model:
        """A model with `effects` added, estimated from its own parameters or from the first vehicle `near`."""
        make_room()
        self.fitter.progress(f"following with {', '.join(effect.label for effect in effects) or 'no effect'}")
        vehicle = near[0] if near else with_scaled_effects(model.view.vehicle, effects, 1.0)
        runs = model.view.runs
        finer = max(runs.substeps, substeps_for(vehicle, runs, model.view.path.start))
        runs, disturbances = dataclasses.replace(runs, substeps=finer), (disturbance, model.view.disturbance)
        view = led_from(vehicle, runs, model.view.sigma, disturbances)
        return self._model(model, view, effects)

    def replaced(self, start: Model, best: Model, label: str, *rival: AbstractEffect) -> Model:
        """The `best` model, which grew from `start`, without one effect or with a `rival` in its place."""
        vehicle = best.view.vehicle.without_effect(label)
        for effect in rival:
            vehicle = vehicle.with_effect(effect)
        before = {effect.label for effect in start.view.vehicle.all_effects}
        more = [effect for effect in vehicle.all_effects if effect.label not in before]
        return self.with_effects(start, more, best.view.disturbance, [vehicle])

    def gain_by(self, best: Model, effect: AbstractEffect) -> Comparison:
        """The gain by one of a model's effects, whose columns are left out for the model without it."""
        fewer = best.predicted._replace(one_step=one_step_ahead(view_without(best.view, effect)[0]))
        return compare(fewer, best.predicted)

    def _model(self, model: Model, view: View, effects: Sequence[AbstractEffect]) -> Model:
        start = view.followed.expected[:, 0]
        cost = jnp.asarray(-evidence_of(view))
        ended = SearchEnd(view.vehicle, view.runs, start, view.sigma, cost, jnp.asarray(0), SUCCESSFUL)
        predicted = model.predicted._replace(one_step=one_step_ahead(view))
        return Model(ended, view, predicted, (*model.added, *effects), model.pieces)


def selector_without(selector: Selector, effect: AbstractEffect) -> Selector:
    """The candidates without one effect of the vehicle, all others present, by the linearisation at its estimate.

    Of a selector that lists the effects present too.
    """
    return selector.seen_from(*view_without(selector.evidence.view, effect))


def view_without(view: View, effect: AbstractEffect) -> tuple[View, np.ndarray]:
    """The view without one effect, on the same trajectory, and the (1 + p, 1 + m) sums of columns that lead to it."""
    rows, values = view.vehicle.layout.free, view.vehicle.values()
    if isinstance(effect, RunVariation):
        return without_variation(view, effect), np.eye(1 + len(rows))
    own = [i for i, row in enumerate(rows) if row.name.startswith(f"{effect.label}.")]
    others = [i for i in range(len(rows)) if i not in own]
    keep = np.eye(1 + len(rows))[:, [0, *(1 + i for i in others)]]
    # its contribution is added to the residual
    for i in amplitude_indices(view, effect):
        keep[1 + i, 0] = float(values[rows[i].name]) * view.length[i]
    across = view.covariance[np.ix_(others, own)]
    taken = across @ np.linalg.solve(view.covariance[np.ix_(own, own)], across.T)
    fewer = dataclasses.replace(
        view,
        vehicle=view.vehicle.without_effect(effect.label),
        covariance=view.covariance[np.ix_(others, others)] - taken,
        base=jax.tree.map(lambda column: column @ keep, view.base),
        prior=keep.T @ view.prior @ keep,
        length=view.length[others],
    )
    return fewer, keep


def validated_in_simulation(fitter: ModelFitter, base: Model, best: Model) -> Model | None:
    """The `best` model by innovations in simulation, if it is accepted against `base`; else None.

    It is fitted in simulation if it is stable enough, else its simulation is re-initialised as often as needed: where
    the simulation of an unstable vehicle diverges, its error identifies nothing.
    """
    fitter.progress(f"simulating with {', '.join(effect.label for effect in best.added)}")
    pieces = segments_needed(best.view)
    if pieces is None:
        return None
    before, after = base, best
    if pieces > 1:
        before, after = (segmented(model, pieces) for model in (base, best))
    else:
        fit = evaluate(continued(best.fit))
        view = look(fit, best.view.disturbance)
        after = fitted_model(fit, view, best.added)
    return after if compare(before.predicted, after.predicted, after.significant).accepted else None


def segments_needed(view: View) -> int | None:
    """The least number of segments of each run in which simulations follow most of the motion; None if none does."""
    runs, measured = view.runs, [view.measured(channel) for channel in view.vehicle.layout.channels]
    variance = np.array([np.var(values) if len(values) else np.inf for values in measured])
    pieces = 1
    while pieces <= runs.times.shape[1] // settings.FEWEST_SAMPLES:
        shown = restarted(view.vehicle, view.followed, runs, pieces)
        rms = concentrated_sigma(residual_outputs(view.vehicle, runs, shown), runs)
        if np.all(np.asarray(rms**2 - view.sigma**2) < (1.0 - settings.NEARLY_ALL) * variance):
            return pieces
        pieces *= 2
    return None


def segmented(model: Model, pieces: int) -> Model:
    """A model with its view's parameters whose simulation is re-initialised in every segment by its filter."""
    view = model.view
    runs, start = view.runs.segments(pieces), starts(view.followed, pieces)
    ended = SearchEnd(view.vehicle, runs, start, view.sigma, model.fit.cost, model.fit.steps, SUCCESSFUL)
    blocks = max(1, settings.BLOCKS // pieces)
    predicted = model.predicted._replace(simulation=simulated(evaluate(ended), blocks, known_start=True))
    return Model(ended, view, predicted, model.added, pieces)
