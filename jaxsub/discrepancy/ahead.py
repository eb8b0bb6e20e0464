"""Models by innovations alone: of a vehicle that does not run free for long, or that lacks many things at once.

Where the vehicle is unstable, as most are that an autopilot steers, a free run is lost within seconds whatever the
model. A filter is held to what was measured, and numbers by its innovations come near the truth one effect after the
other. What is found so is accepted if in the end free runs, begun anew as often as the model needs it, are better with
all of it.
"""

import dataclasses
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np

from ..effects import AbstractEffect
from ..estimate import Ended, evaluate, initial_guess
from ..likelihood import Disturbance, concentrated_sigma, residual_outputs
from ..results import SUCCESSFUL
from ..vehicle import AbstractVehicle
from .acceptance import Model, ModelFitter, fitted_model
from .cross_validation import Comparison, compare, one_step_ahead, simulated
from .evidence import evidence_of
from .model import amplitude_indices, refit, with_scaled_effects
from .programs import make_room
from .restarts import restarted, starts
from .selector import Selector
from .settings import BLOCKS, FEWEST_SAMPLES, MOST_RESTARTS, RESTART_ERROR
from .stiffness import substeps_for
from .view import View, led_from, look


@dataclasses.dataclass(frozen=True)
class Ahead:
    """Models with the numbers that innovations have, compared one step ahead.

    Their simulation errors are taken to be those of the model that they were begun from.
    """

    fitter: ModelFitter

    def begin(self, model: Model) -> Model:
        """A model with its view's numbers."""
        return self._model(model, model.view, ())

    def with_effects(
        self,
        model: Model,
        effects: Sequence[AbstractEffect],
        disturbance: Disturbance,
        near: Sequence[AbstractVehicle] = (),
    ) -> Model:
        """A model with `effects` more, its numbers moved from where they are, or from the first that are `near`."""
        make_room()
        self.fitter.progress(f"following with {', '.join(effect.label for effect in effects)}")
        vehicle = near[0] if near else with_scaled_effects(model.view.vehicle, effects, 1.0)
        runs = model.view.runs
        finer = max(runs.substeps, substeps_for(vehicle, runs, model.view.path.start))
        runs, disturbances = dataclasses.replace(runs, substeps=finer), (disturbance, model.view.disturbance)
        view = led_from(vehicle, runs, model.view.sigma, disturbances)
        return self._model(model, view, effects)

    def instead(self, start: Model, best: Model, label: str, *rival: AbstractEffect) -> Model:
        """The `best` model, begun from `start`, without one effect, or with a `rival` in its place."""
        vehicle = best.view.vehicle.without_effect(label)
        for effect in rival:
            vehicle = vehicle.with_effect(effect)
        before = {effect.label for effect in start.view.vehicle.effects}
        more = [effect for effect in vehicle.effects if effect.label not in before]
        return self.with_effects(start, more, best.view.disturbance, [vehicle])

    def without(self, best: Model, effect: AbstractEffect) -> Comparison:
        """What is gained by one of a model's effects, of which the columns are left out for the model without it."""
        fewer = best.predicted._replace(one_step=one_step_ahead(lacking_view(best.view, effect)[0]))
        return compare(fewer, best.predicted)

    def _model(self, model: Model, view: View, effects: Sequence[AbstractEffect]) -> Model:
        start, _ = initial_guess(view.vehicle, view.runs)
        cost = jnp.asarray(-evidence_of(view))
        ended = Ended(view.vehicle, view.runs, start, view.sigma, cost, jnp.asarray(0), SUCCESSFUL)
        predicted = model.predicted._replace(one_step=one_step_ahead(view))
        return Model(ended, view, predicted, (*model.added, *effects), model.pieces)


def lacking(selector: Selector, effect: AbstractEffect) -> Selector:
    """What would be asked for in the place of one effect of a view's vehicle, by a linear picture from where it stands.

    Once all others are there. Of a selector that lists what is present too.
    """
    return selector.seen_from(*lacking_view(selector.evidence.view, effect))


def lacking_view(view: View, effect: AbstractEffect) -> tuple[View, np.ndarray]:
    """A view of the vehicle without one effect, along the same path, and the (1 + p, 1 + m) sums of columns for it."""
    rows, values = view.vehicle.layout.free, view.vehicle.values()
    own = [i for i, row in enumerate(rows) if row.name.startswith(f"{effect.label}.")]
    others = [i for i in range(len(rows)) if i not in own]
    keep = np.eye(1 + len(rows))[:, [0, *(1 + i for i in others)]]
    # what it does now is no longer there, and so is in the residual
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


def proved(fitter: ModelFitter, base: Model, best: Model) -> Model | None:
    """The `best` model of innovations as it is simulated, if it is accepted beside `base`.

    Fitted to free runs if it runs free, else begun anew as often as it has to be: to where a free run of an unstable
    vehicle is lost a search finds numbers that suit it no more than others.
    """
    fitter.progress(f"free runs with {', '.join(effect.label for effect in best.added)}")
    pieces = pieces_of(best.view)
    if pieces is None:
        return None
    before, after = base, best
    if pieces > 1:
        before, after = (in_pieces(model, pieces) for model in (base, best))
    else:
        fit = refit(best.fit, best.view.vehicle)
        view = look(fit, best.view.disturbance)
        after = fitted_model(fit, view, best.added)
    return after if compare(before.predicted, after.predicted, after.significant).accepted else None


def pieces_of(view: View) -> int | None:
    """Into how few pieces its recordings are cut, if any, that free runs through each leave little of the motion."""
    runs, measured = view.runs, [view.measured(channel) for channel in view.vehicle.layout.channels]
    variance = np.array([np.var(values) if len(values) else np.inf for values in measured])
    pieces = 1
    while pieces <= min(MOST_RESTARTS, runs.times.shape[1] // FEWEST_SAMPLES):
        shown = restarted(view.vehicle, view.followed, runs, pieces)
        rms = concentrated_sigma(residual_outputs(view.vehicle, runs, shown), runs)
        if np.all(np.asarray(rms**2 - view.sigma**2) < RESTART_ERROR * variance):
            return pieces
        pieces *= 2
    return None


def in_pieces(model: Model, pieces: int) -> Model:
    """A model with its view's numbers, whose free runs are begun anew in every piece from what its filter says."""
    view = model.view
    runs, start = view.runs.segments(pieces), starts(view.followed, pieces)
    ended = Ended(view.vehicle, runs, start, view.sigma, model.fit.cost, model.fit.steps, SUCCESSFUL)
    blocks = max(1, BLOCKS // pieces)
    predicted = model.predicted._replace(simulation=simulated(evaluate(ended), blocks, known_start=True))
    return Model(ended, view, predicted, model.added, pieces)
