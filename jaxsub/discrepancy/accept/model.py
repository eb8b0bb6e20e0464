"""A model with added effects: its fit in simulation, and the tests of its parameters."""

import dataclasses
from collections.abc import Sequence

import jax
import numpy as np
from scipy import special

from ...effects import AbstractEffect, AbstractMemory, RunVariation, admissible, amplitudes, numbers, with_numbers
from ...estimate import AbstractSearchEnd, Solution, by_cost, evaluate, race, search, with_estimated_spreads
from ...information import coloured_covariance
from ...vehicle import AbstractVehicle
from ...vehicle.layout import deviation
from .. import settings
from ..linearise.products import integrated
from ..linearise.view import View

# of a column whose squares are zero in floating point
_NO_COLUMN = 1e-100
# a shape so small is zero, SI
_VANISHED = 1e-6


def fit_with(
    view: View,
    fit: AbstractSearchEnd,
    effects: Sequence[AbstractEffect],
    file: AbstractVehicle,
    near: Sequence[AbstractVehicle] = (),
) -> Solution:
    """The vehicle of `fit` with `effects` added, fitted in simulation: multi-start maximum likelihood.

    Starts are the parameters by innovations (`view`), those of the `file`, and the vehicles `near`: a fit without the
    effects may be in an optimum that nothing leads out of, such as a rudder of the wrong sign. Where none of these is
    better than `fit`, starts are its own parameters with the effects at their predicted sizes or a tenth of them.
    Searches that fall behind are given up. Parameters are free that are so in `fit`, others keep its values. Standard
    deviations between runs that the file does not have are estimated anew.
    """
    listed = {effect.label for effect in file.all_effects}
    earlier = [effect for effect in fit.vehicle.all_effects if effect.label not in listed]
    values, free = fit.vehicle.values(), {row.name: row.free for row in fit.vehicle.layout.parameters}
    held = {name: values[name] for name in free if not free[name]}
    raced = lambda starts: race([start.with_values(held).with_freedom(free) for start in starts], fit.runs, fit.sigma)
    best = raced(
        [*near, with_scaled_effects(view.vehicle, effects, 1.0), with_scaled_effects(file, [*earlier, *effects], 1.0)]
    )
    if not float(best.cost) < float(fit.cost):
        best = by_cost([best, raced([with_scaled_effects(fit.vehicle, effects, share) for share in (1.0, 0.1)])])[0]
    added = [name for name in best.vehicle.spreads if name not in file.spreads]
    return evaluate(with_estimated_spreads(best, added) if added else best)


def refit(fit: AbstractSearchEnd, start: AbstractVehicle) -> Solution:
    """The fit of `start` to the runs of a fit."""
    return evaluate(search(start, fit.runs, sigma=fit.sigma))


def with_scaled_effects(vehicle: AbstractVehicle, effects: Sequence[AbstractEffect], share: float) -> AbstractVehicle:
    """`vehicle` with `effects`, their amplitudes scaled by `share`."""
    for effect in effects:
        scaled = {name: share * numbers(effect)[name] for name in amplitudes(effect)}
        vehicle = vehicle.with_effect(with_numbers(effect, scaled))
    return vehicle


def is_admissible(fit: AbstractSearchEnd, effects: Sequence[AbstractEffect]) -> bool:
    """Whether physics admits the fitted parameters of all `effects`, and none of them vanished.

    A memory shorter than a sample acts as a coefficient does. One longer than the runs is a constant in each, as large
    as the run's initial state, which is free.
    """
    labels, shortest = {effect.label for effect in effects}, float(np.min(np.asarray(fit.runs.steps)))
    longest = float(np.max(np.asarray(fit.runs.times)))
    for effect in (e for e in fit.vehicle.all_effects if e.label in labels):
        found, linear, units = numbers(effect), amplitudes(effect), effect.units()
        times = {n for n in found if isinstance(effect, AbstractMemory) and units[n] == "s"}
        least = {n: shortest if n in times else _VANISHED for n in found}
        vanished = any(v <= least[n] for n, v in found.items() if n not in linear)
        if vanished or not admissible(effect, found) or any(found[n] >= longest for n in times):
            return False
    return True


def are_significant(view: View, effects: Sequence[AbstractEffect]) -> bool:
    """Whether each of `effects` is significant (`p_value`), all other parameters free."""
    return all(p_value(view, effect) < settings.SIGNIFICANCE for effect in effects)


def p_value(view: View, effect: AbstractEffect) -> float:
    r"""The p-value of an `effect` of a view's vehicle by Wald's test.

    The statistic $a^T P^{-1} a$ of its amplitudes, or of the parameters of an effect that has none, is $\chi^2$ under
    the null. It is 1 for an effect that changes nothing, such as a limit that nothing reaches. A standard deviation
    between runs is on its bound under the null: twice its gain in log restricted likelihood is
    $\tfrac12\chi^2_0+\tfrac12\chi^2_1$ of many runs, and less of few (Crainiceanu and Ruppert 2004).
    """
    if isinstance(effect, RunVariation):
        gain = restricted_log_likelihood(view) - restricted_log_likelihood(without_variation(view, effect))
        return 0.5 * float(special.chdtrc(1, max(2.0 * gain, 0.0)))
    at = amplitude_indices(view, effect)
    columns = [np.asarray(part)[..., 1:][..., at] for part in jax.tree.leaves(view.base)]
    if all(np.max(np.abs(part)) < _NO_COLUMN for part in columns):
        return 1.0
    return wald_p_value(view, at)


def wald_p_value(view: View, at: Sequence[int]) -> float:
    """Wald's p-value of the free parameters at some indices of a view, each zero under the null."""
    rows, values = view.vehicle.layout.free, view.vehicle.values()
    size = np.array([float(values[rows[i].name]) for i in at])
    wald = size @ np.linalg.solve(view.covariance[np.ix_(at, at)], size)
    return float(special.chdtrc(len(at), max(float(wald), 0.0)))


def without_variation(view: View, effect: RunVariation) -> View:
    """The view without the differences between runs of one number, on the same trajectory."""
    states = view.vehicle.layout.states
    there = np.array([state != deviation(effect.number) for state in states])
    followed = view.followed
    start_std = jax.device_put(np.where(there, np.asarray(followed.system.start_std), 0.0))
    system = dataclasses.replace(followed.system, start_std=start_std)
    return dataclasses.replace(view, followed=dataclasses.replace(followed, system=system))


def restricted_log_likelihood(view: View) -> float:
    """The log restricted likelihood of a view's disturbance, free parameters integrated out."""
    parts = view.products(view.own, view.disturbance)
    return integrated(parts.products.sum(axis=0) + view.prior) - float(parts.log_determinants.sum())


def amplitude_indices(view: View, effect: AbstractEffect) -> list[int]:
    """Indices of an effect's amplitudes, or of its parameters if it has none, among the vehicle's free parameters."""
    names, symbols = [row.name for row in view.vehicle.layout.free], effect.symbols()
    return [names.index(f"{effect.label}.{symbols[name]}") for name in amplitudes(effect) or symbols]


def with_coloured_errors(view: View, ended: AbstractSearchEnd) -> Solution:
    """The fit where a search ended, with standard errors that allow for the view's disturbance."""
    fit = evaluate(ended)
    return dataclasses.replace(fit, covariance=coloured_covariance(fit, view.disturbance).covariance)
