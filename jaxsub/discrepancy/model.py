"""Accepted effects joined to the model, and everything fitted again."""

import dataclasses
from collections.abc import Sequence

import jax
import numpy as np
from scipy import special

from ..effects import AbstractEffect, AbstractMemory, admissible, amplitudes, numbers, with_numbers
from ..estimate import Ended, Fit, evaluate, race, search
from ..identifiability import coloured_covariance
from ..vehicle import AbstractVehicle
from .innovation_search import by_cost
from .settings import NEGLIGIBLE, SIGNIFICANCE
from .view import View

# of a column whose squares are zero in floating point
_NO_COLUMN = 1e-100


def join(
    view: View,
    fit: Ended,
    effects: Sequence[AbstractEffect],
    file: AbstractVehicle,
    near: Sequence[AbstractVehicle] = (),
) -> Fit:
    """The vehicle of `fit` with `effects` more, fitted again as it runs free: what it will be used for.

    The search begins at what innovations say of all numbers, and at the numbers of the `file`: those of a fit that had
    to do without the effects may lie where nothing leads back, such as a rudder that steers the other way. Where
    neither is better than that fit, it begins from the effects' predicted sizes or a tenth of them. It begins too at
    vehicles with these effects that are `near` the answer. Searches that fall behind are given up. Numbers that are
    not free in the fit stay as they are in it.
    """
    listed = {effect.label for effect in file.effects}
    earlier = [effect for effect in fit.vehicle.effects if effect.label not in listed]
    values = fit.vehicle.values()
    held = {row.name: values[row.name] for row in fit.vehicle.layout.parameters if not row.free}
    raced = lambda starts: race([start.with_values(held).holding(held) for start in starts], fit.runs, fit.sigma)
    best = raced([*near, joined(view.vehicle, effects, 1.0), joined(file, [*earlier, *effects], 1.0)])
    if not float(best.cost) < float(fit.cost):
        best = by_cost([best, raced([joined(fit.vehicle, effects, share) for share in (1.0, 0.1)])])[0]
    return evaluate(best)


def freed(fit: Ended, start: AbstractVehicle) -> Fit:
    """The fit of `start` to the runs of a fit."""
    return evaluate(search(start, fit.runs, sigma=fit.sigma))


def joined(vehicle: AbstractVehicle, effects: Sequence[AbstractEffect], share: float) -> AbstractVehicle:
    """`vehicle` with `effects`, their amplitudes scaled by `share`."""
    for effect in effects:
        scaled = {name: share * numbers(effect)[name] for name in amplitudes(effect)}
        vehicle = vehicle.with_effect(with_numbers(effect, scaled))
    return vehicle


def sound(fit: Ended, effects: Sequence[AbstractEffect]) -> bool:
    """Whether all of `effects` came out of a fit with signs that physics admits, and none of them vanished.

    A force whose memory is over within a sample is one without: what it then does, coefficients do. One whose memory
    outlasts the runs is a constant in each, as large as the run's initial state, which is found anew for each.
    """
    labels, shortest = {effect.label for effect in effects}, float(np.min(np.asarray(fit.runs.steps)))
    longest = float(np.max(np.asarray(fit.runs.times)))
    for effect in (e for e in fit.vehicle.effects if e.label in labels):
        found, linear, units = numbers(effect), amplitudes(effect), effect.units()
        times = {n for n in found if isinstance(effect, AbstractMemory) and units[n] == "s"}
        least = {n: shortest if n in times else NEGLIGIBLE for n in found}
        vanished = any(v <= least[n] for n, v in found.items() if n not in linear)
        if vanished or not admissible(effect, found) or any(found[n] >= longest for n in times):
            return False
    return True


def told(view: View, effects: Sequence[AbstractEffect]) -> bool:
    """Whether the recordings tell each of `effects` from nothing, whatever all other numbers are."""
    return all(p_value(view, effect) < SIGNIFICANCE for effect in effects)


def p_value(view: View, effect: AbstractEffect) -> float:
    r"""How probable so large an `effect` of a view's vehicle is where there is none.

    By the Wald statistic $a^T P^{-1} a$ of its amplitudes, which then is $\chi^2$, or of the numbers of an effect that
    has no amplitude. One that changes nothing, such as a limit that nothing reaches, is not told, however large it is.
    """
    names, values, at = [row.name for row in view.vehicle.layout.free], view.vehicle.values(), places(view, effect)
    columns = [np.asarray(part)[..., 1:][..., at] for part in jax.tree.leaves(view.base)]
    if all(np.max(np.abs(part)) < _NO_COLUMN for part in columns):
        return 1.0
    size = np.array([float(values[names[i]]) for i in at])
    wald = size @ np.linalg.solve(view.covariance[np.ix_(at, at)], size)
    return float(special.chdtrc(len(at), max(float(wald), 0.0)))


def places(view: View, effect: AbstractEffect) -> list[int]:
    """Where an effect's amplitudes, or its numbers if it has none, are among the free numbers of a view's vehicle."""
    names, symbols = [row.name for row in view.vehicle.layout.free], effect.symbols()
    return [names.index(f"{effect.label}.{symbols[name]}") for name in amplitudes(effect) or symbols]


def allowing_for(view: View, ended: Ended) -> Fit:
    """The fit where a search ended, with errors of its numbers that allow for the disturbance that its view has."""
    fit = evaluate(ended)
    return dataclasses.replace(fit, covariance=coloured_covariance(fit, view.disturbance).covariance)
