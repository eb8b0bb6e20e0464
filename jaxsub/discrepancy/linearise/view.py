"""A fitted model linearised about its filtered trajectory: what all evidence is computed from."""

import dataclasses
from collections.abc import Callable, Iterable
from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Array, Float, Int

from ...arrays import quietly
from ...effects import Facts, wave_band
from ...estimate import Problem, Solution, by_cost
from ...likelihood import (
    Columns,
    Disturbance,
    FilteredRuns,
    Linearised,
    Response,
    System,
    first_guess,
    part_length,
    part_products,
    response,
    share_of,
    smoothed,
)
from ...programs import compiled, on_cores
from ...recording.runs import Runs
from ...simulation import Trajectory
from ...vehicle import AbstractVehicle, numbers_that_may_vary, quantities_of
from .. import settings
from .innovation_search import InnovationSearch, Iterate, distinct, fitted_states, left_over
from .tones import tones
from .whiteness import record_sigma

# channels tried as the only faulty one
_DOUBTED = 3
# of the disturbance that would explain all of the misfit: a start that the search can grow from
_QUIET = 1e-2
_LEAST_WHITE = 1e-5


class Parts(NamedTuple):
    """Of m parts of the recordings: products of whitened columns, and half the log-determinants of covariances."""

    products: Float[np.ndarray, "m q q"]
    log_determinants: Float[np.ndarray, " m"]

    def of(self, length: Float[np.ndarray, " n"]) -> "Parts":
        """Those of the first n columns, each divided by its `length`."""
        count = len(length)
        return self._replace(products=self.products[:, :count, :count] / np.outer(length, length))


@dataclasses.dataclass(frozen=True)
class View:
    """A model linearised about its filtered trajectory.

    **Fields**

    - `vehicle`: with the free parameters estimated by innovations. `covariance`: (p, p) theirs, physical.
    - `runs`, `sigma`: the recordings and their noise, SI.
    - `followed`: the filter's pass over the runs. `disturbance`: the one that it assumed.
    - `path`: its trajectory. `base`: the residual's column and those of the free parameters, each of unit length under
      `disturbance`; `prior`: (p + 1, p + 1) of them. `length`: (p,) what each was divided by.
    """

    vehicle: AbstractVehicle
    covariance: np.ndarray
    runs: Runs
    sigma: Array
    followed: FilteredRuns
    disturbance: Disturbance
    path: Trajectory
    base: Columns
    prior: Float[np.ndarray, "p1 p1"]
    length: np.ndarray

    @property
    def finite(self) -> bool:
        """Whether the filter passed over all of the recordings without divergence."""
        return bool(np.all(np.isfinite(self.covariance)))

    def own(self, some: slice) -> Columns:
        """The residual's column and those of the free parameters in a share of the runs."""
        return share_of(self.base, some)

    def products(
        self, columns: Callable[[slice], Columns], disturbance: Disturbance, pieces: int | None = None
    ) -> Parts:
        """Products of columns whitened under a disturbance, in parts of the recordings.

        `columns` gives those of a share of the runs. Every run is cut into so many `pieces`, or so that there are at
        least four parts.
        """
        system = self.followed.system
        pieces = pieces or max(1, -(-settings.BLOCKS // len(system.measured)))
        found, spreads = part_products(disturbance, system, columns, pieces)
        return Parts(found.reshape(-1, *found.shape[2:]), spreads.reshape(-1))

    def measured_by_part(self, pieces: int) -> Int[np.ndarray, " m"]:
        """How many values were measured in each part that `products` makes of the recordings."""
        counts = np.asarray(self.followed.system.measured).sum(axis=-1)
        length = part_length(counts.shape[1], pieces)
        whole = np.pad(counts, [(0, 0), (0, pieces * length - counts.shape[1])])
        return whole.reshape(-1, length).sum(axis=1)

    def measured(self, channel: str) -> np.ndarray:
        """All samples that `channel` has in the recordings, SI."""
        column = self.vehicle.layout.channels.index(channel)
        return np.asarray(self.runs.outputs)[..., column][np.asarray(self.runs.mask)[..., column]]


def look(fit: Solution, disturbance: Disturbance | None = None, near: AbstractVehicle | None = None) -> View:
    """The view of a fit, its free parameters and disturbance re-estimated by innovations.

    The disturbance starts from a guess by the residuals, or from the given one, of a view of nearly the same model,
    where that is better.

    Where a fit leaves errors far above the noise, parameters start too from a vehicle that is `near`, such as that of
    the file: a fit without the missing physics may be in an optimum that nothing leads out of. They start from it alone
    where the fit found no optimum. Its initial states are not trusted either, and the filter begins at their prior.
    Without a disturbance given, the search is then a multi-start one, whose better half goes on after each alternation:
    the misfit is first attributed to forces, or to sensors, since forces that follow a faulty sensor bias all others.
    It ends along the path from the initial states that all samples then show.
    """
    problem, rms = fit.problem, fit.rms
    much = max(rms.values()) > settings.LARGE_ERROR
    search = InnovationSearch(problem, problem.guess) if much else InnovationSearch(problem, *_trusted(fit))
    guess = dataclasses.replace(guessed(fit), noise=_white(fit))
    vehicles = [fit.vehicle]
    if much and near is not None:
        # where no optimum was found, a search may have led anywhere
        vehicles = [fit.vehicle, near] if fit.at_optimum else [near]
    best = lambda pairs: by_cost(search.evaluate(*pair) for pair in pairs)[0]
    if disturbance is not None:
        iterates = [best([(v, start) for v in vehicles for start in (guess, disturbance)])]
    elif much:
        in_sensors, doubted = _doubting(guess, np.array([rms[c] for c in fit.vehicle.layout.channels]))
        iterates = [search.evaluate(v, start) for v in vehicles for start in (guess, in_sensors)]
        iterates += by_cost(best([(v, start) for v in vehicles]) for start in doubted)[:_DOUBTED]
    else:
        iterates = [search.evaluate(fit.vehicle, guess)]
    while len(iterates) > 1:
        iterates = distinct(search.alternated(iterate) for iterate in iterates)
        iterates = iterates[: max(1, len(iterates) // 2)]
    found = search.converged(iterates[0])
    return _view(search, search.from_smoothed(found, InnovationSearch.converged) if much else found)


def led_from(vehicle: AbstractVehicle, runs: Runs, sigma: Array, disturbances: Iterable[Disturbance]) -> View:
    """The view of a vehicle, its free parameters estimated by innovations from where they are.

    One search, from the best of some disturbances: most parameters come from innovations already. It goes on until it
    converges, since the first steps are far from linear, and then along the path from the initial states that all
    samples show.
    """
    problem = Problem.of(vehicle, runs, sigma)
    search = InnovationSearch(problem, problem.guess)
    found = search.maximised(by_cost(search.evaluate(vehicle, one) for one in disturbances)[0])
    return _view(search, search.from_smoothed(found, InnovationSearch.maximised))


@quietly
def _trusted(fit: Solution) -> tuple[Array, Float[np.ndarray, "r s s"]]:
    """Initial states of a fit and their covariances, the parameters held, but for runs' deviations.

    The filter is to show how well those are predicted: they have their priors.
    """
    layout, spread = fit.vehicle.layout, np.asarray(fit.problem.start_std)
    fitted = fitted_states(layout)
    states = slice(len(layout.free), len(layout.free) + len(spread))
    information = fit.model.products[:, states, states] * np.outer(fitted, fitted) + np.eye(len(spread))
    start = jax.device_put(np.where(fitted, np.asarray(fit.start), np.asarray(fit.problem.guess)))
    return start, np.linalg.inv(information) * np.outer(spread, spread)


@quietly
def _view(search: InnovationSearch, iterate: Iterate) -> View:
    """The view at an iterate of a search."""
    runs, sigma, followed = search.problem.runs, search.problem.sigma, iterate.followed
    path = Trajectory.of(iterate.vehicle, runs, followed.expected, followed.filtered)
    covariance = np.linalg.inv(iterate.gram[1:, 1:]) / np.outer(iterate.length, iterate.length)
    return View(
        iterate.vehicle,
        covariance,
        runs,
        sigma,
        followed,
        iterate.disturbance,
        path,
        iterate.base,
        iterate.prior,
        iterate.length,
    )


def _doubting(guess: Disturbance, rms: Float[np.ndarray, " c"]) -> tuple[Disturbance, list[Disturbance]]:
    """Disturbances by which a misfit, `rms` over sigma of each channel, is noise of all channels, or of one.

    Of one for each channel with a large misfit; that of the others is then attributed to forces.
    """
    noisy = np.maximum(guess.noise, rms)
    alone = [np.where(own, noisy, guess.noise) for own in np.diag(rms > settings.LARGE_ERROR) if own.any()]
    every = Disturbance(_QUIET * np.asarray(guess.force), guess.time, noisy)
    return every, [dataclasses.replace(guess, noise=noise) for noise in alone]


@quietly
def guessed(fit: Solution) -> Disturbance:
    """The first guess of the disturbance, by the residuals of a fit."""

    def of(number: int) -> Response:
        return jax.device_get(_response(*fit.model.share(number), fit.sigma, fit.problem.start_std))

    return first_guess(on_cores(of, [(number,) for number in range(len(fit.model.shares))]), len(fit.sigma))


@compiled
def _response(runs: Runs, model: Linearised, sigma: Array, start_std: Array) -> Response:
    return response(System.of(model, runs, sigma, start_std), model.error / sigma)


def _white(fit: Solution) -> np.ndarray:
    """The first guess of each channel's noise, in units of the fit's: the white part of its errors.

    A sigma that the file leaves open has so far absorbed the whole simulation error, which may be a thousand times it.
    """
    white = record_sigma(np.asarray(fit.model.error), np.asarray(fit.runs.mask)) / np.asarray(fit.sigma)
    given = np.array([output.sigma is not None for output in fit.vehicle.layout.outputs])
    return np.where(given, 1.0, np.clip(white, _LEAST_WHITE, 1.0))


def missing_force(view: View) -> tuple[Float[np.ndarray, "r k n"], Float[np.ndarray, "r k n"]]:
    """The smoothed disturbance force (N, N m), which the model lacks, and its standard deviation."""
    found = smoothed(view.disturbance, view.followed.system, _left(view))
    return np.asarray(found.force), np.asarray(found.deviation)


def _left(view: View) -> Columns:
    """The innovations less their projection on the free parameters."""
    gram = np.sum(view.products(view.own, view.disturbance).products, axis=0) + view.prior
    return left_over(view.base, gram)


def facts(view: View) -> Facts:
    """What the vocabulary needs to know to list its candidates."""
    layout, runs, path = view.vehicle.layout, view.runs, view.path
    live = np.asarray(runs.live)
    rms = lambda values: max(float(np.sqrt(np.mean(np.asarray(values)[live] ** 2))), 1e-9)
    body = layout.kind == "submerged-body"
    shown = {channel: view.measured(channel) for channel in layout.channels}
    duration, interval = float(np.max(np.sum(path.steps, axis=1))), float(np.median(path.steps[live]))
    shaking, frequencies = [], 0
    if body and duration > 0.0:
        there = np.pad(live, [(0, 0), (1, 0)], constant_values=True)
        shaking, frequencies = tones(missing_force(view)[0], path.times, there, wave_band(duration, interval))
    return Facts(
        layout.kind,
        layout.equations,
        tuple(name for name, _ in layout.inputs),
        layout.channels,
        tuple(name for name, _ in layout.environment),
        layout.length,
        layout.diameter,
        {e: rms(path.start.rates[e]) for e in layout.equations},
        interval,
        duration=duration,
        position_scale={} if body else {q: float(np.max(np.abs(path.seen.positions[q]))) for q in layout.equations},
        input_range={name: _commanded(path, live, i) for i, (name, _) in enumerate(layout.inputs)},
        output_range={c: (float(values.min()), float(values.max())) for c, values in shown.items() if len(values)},
        depth_range=_depths(view) if body else (0.0, 0.0),
        tones=dict(zip(layout.equations, shaking, strict=False)),
        frequencies=frequencies,
        quantities=quantities_of(layout.outputs, body),
        has=view.vehicle.has,
        fixed_gains=view.vehicle.fixed_gains,
        density=view.vehicle.density,
        speed=view.vehicle.speed,
        varying=_varying(view),
        prescribed=tuple(name for name, _ in layout.prescribed if body and name not in layout.channels),
    )


def _depths(view: View) -> tuple[float, float]:
    """Least and largest depth of a body, m, alike of one that neither heaves nor pitches."""
    layout, depth = view.vehicle.layout, np.asarray(view.path.seen.positions["z"])
    dives = {"heave", "pitch", "theta", "z"}.intersection([*layout.equations, *(name for name, _ in layout.prescribed)])
    least = float(depth.min())
    return least, float(depth.max()) if dives else least


def _varying(view: View) -> tuple[tuple[str, str, tuple[str, ...]], ...]:
    """The free numbers that may differ by run and do not yet, with their units and the places that they act on.

    Those are the equations with more than `PLACE_SHARE` of the squared forces over their inertia, or the sensors where
    there is no force. None may differ between two runs: what differs is one contrast, and any effect that acts unlike
    in the two explains as much.
    """
    if len(view.runs.times) < 3:
        return ()
    layout, mass = view.vehicle.layout, np.asarray(view.vehicle.mass_matrix())
    shown, forcing = (np.asarray(part)[..., 1:] for part in (view.base.shown, view.base.forcing))
    n, may = len(mass), numbers_that_may_vary(view.vehicle)
    found = []
    for i, row in enumerate(layout.free):
        if row.varies or row.name not in may:
            continue
        # over the inertia forces and moments have one unit
        force = np.sum((forcing[..., :n, i] @ mass.T) ** 2, axis=(0, 1)) / np.diag(mass)
        names, squares = layout.equations, force
        if not np.any(force):
            names, squares = tuple(f"sensor:{c}" for c in layout.channels), np.sum(shown[..., i] ** 2, axis=(0, 1))
        least = settings.PLACE_SHARE * np.sum(squares)
        places = tuple(e for e, part in zip(names, squares, strict=True) if part > least)
        found.append((row.name, row.unit, places))
    return tuple(found)


def _commanded(path: Trajectory, live: np.ndarray, column: int) -> tuple[float, float, float]:
    """Rms, largest size and largest rate of what an actuator does."""
    command = path.nodes[:, :, 0, column]
    turned = (np.abs(np.diff(command, axis=1)) / np.maximum(path.steps[:, :-1], 1e-9))[live[:, 1:]]
    command = command[live]
    return float(np.sqrt(np.mean(command**2))), float(np.max(np.abs(command))), float(np.max(turned, initial=0.0))
