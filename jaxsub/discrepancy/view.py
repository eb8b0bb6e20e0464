"""A fitted model as a filter of it follows its recordings: what every question about left-out physics is asked of."""

import dataclasses
from collections.abc import Iterable

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Array, Float, Int

from ..arrays import quietly
from ..effects import Facts, Motion, wave_band
from ..estimate import Fit, Problem
from ..likelihood import (
    Columns,
    Disturbance,
    Followed,
    Linearised,
    System,
    first_guess,
    part_length,
    part_products,
    smoothed,
)
from ..recording.runs import Runs
from ..vehicle import AbstractVehicle
from .innovation_search import InnovationSearch, Iterate, by_cost, distinct, with_wide_priors
from .settings import BLOCKS, LARGE_ERROR
from .tones import tones
from .whiteness import record_sigma

# of the channels that may alone be wrong, those that are tried
_DOUBTED = 3
# of the forces that would explain all that is left: too small to lead a path, and large enough to grow from
_QUIET = 1e-2
_LEAST_WHITE = 1e-5


class Trajectory(eqx.Module):
    """The motion that took place, as NumPy arrays: what effects are evaluated on.

    NumPy on purpose: a force is a handful of array operations, so a vocabulary of any size costs no compilation.

    **Fields**

    - `start`, `end`: at both ends of every interval, (R, K-1): filtered, and what was expected from there.
    - `seen`: at every sample, (R, K), as expected; `true`: (R, K) measured channels there, before any sensor effect.
    - `nodes`: (R, K-1, 3, m) signals after the actuators, time last. `times`: (R, K) s; `steps`: (R, K-1) s, 0 where
      padded.
    """

    start: Motion
    end: Motion
    seen: Motion
    true: dict[str, np.ndarray]
    nodes: np.ndarray
    times: np.ndarray
    steps: np.ndarray

    @classmethod
    def of(cls, vehicle: AbstractVehicle, runs: Runs, expected: Array, filtered: Array) -> "Trajectory":
        """Along states (R, K, s) expected and filtered."""
        found = _trajectory(vehicle, runs, expected, filtered)
        steps = np.where(runs.live, np.asarray(runs.steps)[np.asarray(runs.step_of)], 0.0)
        return cls(*(jax.tree.map(np.asarray, part) for part in (*found, runs.times, steps)))


@eqx.filter_jit
def _trajectory(vehicle: AbstractVehicle, runs: Runs, expected: Array, filtered: Array) -> tuple:
    nodes = jax.vmap(vehicle.actuate)(runs.times, runs.nodes())
    start = vehicle.motion(filtered[:, :-1], nodes[:, :, 0])
    end = vehicle.motion(expected[:, 1:], nodes[:, :, 2])
    true, seen = vehicle.truth(runs.times, expected, runs.signals)
    return start, end, seen, true, nodes


@dataclasses.dataclass(frozen=True)
class View:
    """A model as its recordings lead it.

    **Fields**

    - `vehicle`: with the free numbers that innovations of least squares have. `covariance`: (p, p) theirs, physical.
    - `runs`, `sigma`: the recordings and their noise, SI.
    - `followed`: the runs as the model's filter followed them. `disturbance`: under which it did.
    - `path`: its motion. `base`: the residual's column and those of the free parameters, each of unit length under
      `disturbance`; `prior`: (p + 1, p + 1) of them. `length`: (p,) what each was divided by.
    """

    vehicle: AbstractVehicle
    covariance: np.ndarray
    runs: Runs
    sigma: Array
    followed: Followed
    disturbance: Disturbance
    path: Trajectory
    base: Columns
    prior: Float[np.ndarray, "p1 p1"]
    length: np.ndarray

    @property
    def finite(self) -> bool:
        """Whether the model could be led along all of the recordings, or diverged on the way."""
        return bool(np.all(np.isfinite(self.covariance)))

    def products(
        self, columns: Columns, disturbance: Disturbance, pieces: int | None = None
    ) -> tuple[Float[np.ndarray, "m q q"], Float[np.ndarray, " m"]]:
        """Products of `columns` whitened under a disturbance, in m parts of the recordings, and half the
        log-determinant of each part's covariance. Every run is cut into so many `pieces`, or so that there are four.
        """
        system = self.followed.system
        pieces = pieces or max(1, -(-BLOCKS // len(system.measured)))
        found, spreads = part_products(disturbance, system, columns, pieces)
        return found.reshape(-1, *found.shape[2:]), spreads.reshape(-1)

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


def look(fit: Fit, disturbance: Disturbance | None = None, file: AbstractVehicle | None = None) -> View:
    """The view of a fit, its free numbers moved to where innovations are least.

    The search for the disturbance starts from what the residuals ask, or from the given one where that is better: after
    a fit that explains more, it is far too large, and numbers that are moved under it are lost.

    Where a fit leaves much, several searches are begun and the better half goes on after each turn. Numbers are moved
    from those of the fit and from those of the `file`: a fit that has to do without the physics may end where nothing
    leads back. Nor are its initial states to be trusted, and a filter begins at what is known before the fit. And what
    is left is put down to forces at first, or to sensors: forces that follow a sensor which is wrong make the right
    ones wrong.

    Numbers of the file are taken to be of the right order. Where recordings hardly tell them, such as without a
    velocity log, numbers a hundred times too large can do what an actuator's force does, and nothing would be left to
    name it by.
    """
    problem, rms = with_wide_priors(fit.problem), fit.rms
    # such a fit is not trusted to have ended near the truth
    much = max(rms.values()) > LARGE_ERROR
    search = InnovationSearch(problem, problem.guess if much else fit.start)
    guess = dataclasses.replace(_guessed(fit.model.whole, fit.runs, fit.sigma, problem.spread), noise=_white(fit))
    vehicles, starts, doubted = [fit.vehicle], [[guess] if disturbance is None else [guess, disturbance]], []
    if much:
        vehicles += [file] if file is not None else []
        in_sensors, doubted = _doubting(guess, np.array([rms[c] for c in fit.vehicle.layout.channels]))
        starts.append([in_sensors])
    best = lambda pairs: by_cost(search.evaluate(*pair) for pair in pairs)[0]
    iterates = [best([(v, start) for start in some]) for v in vehicles for some in starts]
    iterates += by_cost(best([(v, start) for v in vehicles]) for start in doubted)[:_DOUBTED]
    while len(iterates) > 1:
        iterates = distinct(search.alternated(iterate) for iterate in iterates)
        iterates = iterates[: max(1, len(iterates) // 2)]
    return _view(search, search.converged(iterates[0]))


def led_from(vehicle: AbstractVehicle, runs: Runs, sigma: Array, disturbances: Iterable[Disturbance]) -> View:
    """The view of a vehicle, its free numbers moved from where they are to where innovations are least.

    One search, from the best of some disturbances: of numbers that came of innovations already, but for a few. It goes
    on until it arrives: of what is far off, a linear picture promises much that is not so.
    """
    problem = with_wide_priors(Problem.of(vehicle, runs, sigma))
    search = InnovationSearch(problem, problem.guess)
    return _view(search, search.maximised(by_cost(search.evaluate(vehicle, one) for one in disturbances)[0]))


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
    """What a fit leaves, `rms` over sigma of each channel, put down to the noise of all channels; or of one that it
    leaves much in, and in the others to forces: for each such.
    """
    noisy = np.maximum(guess.noise, rms)
    alone = [np.where(own, noisy, guess.noise) for own in np.diag(rms > LARGE_ERROR) if own.any()]
    every = Disturbance(_QUIET * np.asarray(guess.force), guess.time, noisy)
    return every, [dataclasses.replace(guess, noise=noise) for noise in alone]


@eqx.filter_jit
def _guessed(model: Linearised, runs: Runs, sigma: Array, spread: Array) -> Disturbance:
    """Where to look for the forces in what a fit leaves."""
    return first_guess(System.of(model, runs, sigma, spread), model.error / sigma)


def _white(fit: Fit) -> np.ndarray:
    """Where to look for the noise of each channel, in units of the fit's: what is white in its errors.

    A noise that the file leaves open is the whole misfit of a free run until now, which may be a thousand times larger.
    """
    white = record_sigma(np.asarray(fit.model.error), np.asarray(fit.runs.mask)) / np.asarray(fit.sigma)
    given = np.array([output.sigma is not None for output in fit.vehicle.layout.outputs])
    return np.where(given, 1.0, np.clip(white, _LEAST_WHITE, 1.0))


def missing_force(view: View) -> tuple[Float[np.ndarray, "r k n"], Float[np.ndarray, "r k n"]]:
    """The force (N, N m) that the recordings ask for beyond the model given all samples, and its standard deviation."""
    mean, spread = smoothed(view.disturbance, view.followed.system, _left(view))
    return np.asarray(mean), np.asarray(spread)


def _left(view: View) -> Columns:
    """The residual, less what the free parameters take up of it."""
    gram = np.sum(view.products(view.base, view.disturbance)[0], axis=0) + view.prior
    weights = np.array([1.0, *-np.linalg.solve(gram[1:, 1:], gram[1:, 0])])
    return jax.tree.map(lambda column: (column @ weights)[..., None], view.base)


def facts(view: View) -> Facts:
    """What the vocabulary needs to know to list its candidates."""
    layout, runs, path = view.vehicle.layout, view.runs, view.path
    live = np.asarray(runs.live)
    rms = lambda values: max(float(np.sqrt(np.mean(np.asarray(values)[live] ** 2))), 1e-9)
    body = layout.kind == "submerged-body"
    depth = np.asarray(path.seen.positions["z"]) if body else np.zeros(1)
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
        depth_range=(float(depth.min()), float(depth.max())),
        tones=dict(zip(layout.equations, shaking, strict=False)),
        frequencies=frequencies,
        has=view.vehicle.has,
    )


def _commanded(path: Trajectory, live: np.ndarray, column: int) -> tuple[float, float, float]:
    """Rms, largest size and largest rate of what an actuator does."""
    command = path.nodes[:, :, 0, column]
    turned = (np.abs(np.diff(command, axis=1)) / np.maximum(path.steps[:, :-1], 1e-9))[live[:, 1:]]
    command = command[live]
    return float(np.sqrt(np.mean(command**2))), float(np.max(np.abs(command))), float(np.max(turned, initial=0.0))
