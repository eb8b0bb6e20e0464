"""Models by innovations alone: of a vehicle that does not run free for long, or that lacks many things at once.

Where the vehicle is unstable, as most are that an autopilot steers, a free run is lost within seconds whatever the
model. A filter is held to what was measured, and numbers by its innovations come near the truth one effect after the
other. What is found so is believed if in the end free runs through the held-out runs, begun anew as often as the model
needs it, err less with all of it.
"""

import dataclasses
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np

from ..effects import AbstractEffect, amplitudes
from ..estimate import Ended, initial_guess
from ..likelihood import Disturbance, concentrated_sigma, residual_outputs
from ..results import SUCCESSFUL
from ..vehicle import AbstractVehicle
from .evidence import evidence_of
from .model import freed, joined, places
from .programs import make_room
from .selector import Selector
from .show import HeldOut, Luck, begun_anew, expects, luck, starts
from .stiffness import substeps_for
from .trial import Model, Trial
from .view import View, led_from, look

# the most pieces into which a run is cut, the fewest samples of one, and of what was measured, the share of variance
# that a free run may leave
_PIECES, _FEWEST, _LEFT = 64, 8, 0.1
# of a number without which an effect would be none
_AS_NOTHING = 1e-3


@dataclasses.dataclass(frozen=True)
class Ahead:
    """Models with the numbers that innovations have, tried by what comes next on the held-out runs of a trial.

    The free runs of what they show are those of the model that they were begun from.
    """

    trial: Trial

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
        self.trial.progress(f"following with {', '.join(effect.label for effect in effects)}")
        vehicle = near[0] if near else joined(model.view.vehicle, effects, 1.0)
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

    def without(self, best: Model, effect: AbstractEffect) -> Luck:
        """What the held-out runs gain by one of a model's effects.

        Without it the other numbers are where innovations would have them by a linear picture, which is close: beside
        it they are told, and no program is made for a vehicle that has one effect less.
        """
        fewer = self._shown(best.shown, best.view, less(best.view, effect))
        return luck(fewer, best.shown, True, freely=False)

    def _model(self, model: Model, view: View, effects: Sequence[AbstractEffect]) -> Model:
        start, _ = initial_guess(view.vehicle, view.runs)
        cost = jnp.asarray(-evidence_of(view))
        ended = Ended(view.vehicle, view.runs, start, view.sigma, cost, jnp.asarray(0), SUCCESSFUL)
        return Model(ended, view, self._shown(model.shown, view, view.vehicle), (*model.added, *effects))

    def _shown(self, shown: HeldOut, view: View, vehicle: AbstractVehicle) -> HeldOut:
        """What `shown` is with what a `vehicle` expects under the disturbance of a view."""
        trial, runs = self.trial, self.trial.all_runs(view.runs.substeps)
        expected = expects(vehicle, runs, trial.chosen, trial.size, trial.sigma, view.disturbance)
        return dataclasses.replace(shown, expected=expected)


def less(view: View, effect: AbstractEffect) -> AbstractVehicle:
    r"""A view's vehicle with as good as nothing of one effect, $\theta - P_{\cdot a} P_{aa}^{-1} (a - a_0)$."""
    rows, values, at = view.vehicle.layout.free, view.vehicle.values(), places(view, effect)
    here = np.array([float(values[row.name]) for row in rows])
    # a lag or the like that is zero is another kind of thing
    gone = (0.0 if amplitudes(effect) else _AS_NOTHING) * here[at]
    moved = here - view.covariance[:, at] @ np.linalg.solve(view.covariance[np.ix_(at, at)], here[at] - gone)
    moved = np.clip(moved, [row.lower for row in rows], [row.upper for row in rows])
    moved[at] = gone
    return view.vehicle.with_values({row.name: jnp.asarray(value) for row, value in zip(rows, moved, strict=True)})


def lacking(selector: Selector, effect: AbstractEffect) -> Selector:
    """What would be asked for in the place of one effect of a view's vehicle, by a linear picture from where it stands.

    Once all others are there. Of a selector that lists what is present too.
    """
    view = selector.evidence.view
    rows, values = view.vehicle.layout.free, view.vehicle.values()
    own = [i for i, row in enumerate(rows) if row.name.startswith(f"{effect.label}.")]
    others = [i for i in range(len(rows)) if i not in own]
    keep = np.eye(1 + len(rows))[:, [0, *(1 + i for i in others)]]
    # what it does now is no longer there, and so is in the residual
    for i in places(view, effect):
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
    return selector.seen_from(fewer, keep)


def proved(trial: Trial, base: Model, best: Model) -> Model | None:
    """The `best` model of innovations as free runs show it, if those through the held-out runs err less than `base`'s.

    Fitted to free runs if it runs free through the training runs, else begun anew as often as it has to be: to where a
    free run of an unstable vehicle is lost a search finds numbers that suit it no more than others.
    """
    trial.progress(f"free runs with {', '.join(effect.label for effect in best.added)}")
    pieces = pieces_of(best.view)
    if pieces is None:
        return None
    before, after = base, best
    if pieces > 1:
        before, after = (in_pieces(trial, model, pieces) for model in (base, best))
    else:
        fit = freed(best.fit, best.view.vehicle)
        view = look(fit, best.view.disturbance)
        after = Model(fit, view, trial.held_out(fit, view.disturbance), best.added)
    return after if luck(before.shown, after.shown, after.stands, freely=True).helps else None


def pieces_of(view: View) -> int | None:
    """Into how few pieces its recordings are cut, if any, that free runs through each leave little of the motion."""
    runs, measured = view.runs, [view.measured(channel) for channel in view.vehicle.layout.channels]
    variance = np.array([np.var(values) if len(values) else np.inf for values in measured])
    pieces = 1
    while pieces <= min(_PIECES, runs.times.shape[1] // _FEWEST):
        shown = begun_anew(view.vehicle, view.followed, runs, pieces)
        rms = concentrated_sigma(residual_outputs(view.vehicle, runs, shown), runs)
        if np.all(np.asarray(rms**2 - view.sigma**2) < _LEFT * variance):
            return pieces
        pieces *= 2
    return None


def in_pieces(trial: Trial, model: Model, pieces: int) -> Model:
    """A model with its view's numbers, whose free runs are begun anew in every piece from what its filter says."""
    view = model.view
    runs, start = view.runs.segments(pieces), starts(view.followed, pieces)
    ended = Ended(view.vehicle, runs, start, view.sigma, model.fit.cost, model.fit.steps, SUCCESSFUL)
    return Model(ended, view, trial.held_out(ended, view.disturbance, pieces), model.added)
