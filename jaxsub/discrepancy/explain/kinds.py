r"""The posterior probability of each kind of mismatch: structure, actuator, sensor, environment, or the file's values.

Where effects were accepted, a kind is missing unless each of them, or its true rival, is of another. Where none was, it
is by the first examination: the evidence of a kind is the mean over its effects, every name equally probable a priori;
that of `disturbance` is the evidence of the disturbance and noise alone. Structure includes the nonparametric force.
Where simulation selected the leading effect, it is the evidence of the simulation error.

The file's values are tested in the model with the accepted effects, since missing physics biases coefficients:
$\chi^2 = d^TC^{-1}d$, d from the estimates to the file's values and C the covariance of the estimates.
"""

from collections.abc import Sequence

import numpy as np
from scipy import special

from ...effects import AbstractActuator, AbstractEffect, AbstractInstrument
from ...vehicle import AbstractVehicle
from ..accept.acceptance import Examination
from ..linearise.view import View
from ..propose.name import Named

_FAMILIES = {"actuators": "actuator", "sensors": "sensor", "environment": "environment"}
_STRUCTURE, _DISTURBANCE = "structure", "disturbance"


def kind(effect: AbstractEffect) -> str:
    """What kind of thing is wrong where `effect` is missing; a family that is not known is structure."""
    if isinstance(effect, AbstractActuator):
        return "actuator"
    return "sensor" if isinstance(effect, AbstractInstrument) else _FAMILIES.get(effect.family, _STRUCTURE)


def missing(named: Sequence[Named]) -> dict[str, float]:
    """Posterior probability of each kind that an effect of it is missing, by accepted effects and their rivals."""
    absent: dict[str, float] = {}
    for one in named:
        of_kind: dict[str, float] = {}
        for effect, probability in ((one.effect, one.probability), *one.rivals):
            of_kind[kind(effect)] = of_kind.get(kind(effect), 0.0) + probability
        for own, probability in of_kind.items():
            absent[own] = absent.get(own, 1.0) * max(0.0, 1.0 - probability)
    return _sorted({own: 1.0 - none for own, none in absent.items()})


def leading(found: Examination) -> dict[str, float]:
    """Posterior probability of each kind that it holds the largest mismatch, by the first examination."""
    selector, scan = found.selector, found.naming.first
    of_name: dict[tuple[str, str], list[float]] = {}
    for effect, value in zip(selector.candidates, scan.value, strict=True):
        of_name.setdefault((kind(effect), effect.name), []).append(float(value))
    if found.pattern is not None:
        of_name[_STRUCTURE, found.pattern.force.name] = [found.pattern.alone]
    of_kind = {_DISTURBANCE: [selector.value([])]}
    for (own, _), forms in of_name.items():
        of_kind.setdefault(own, []).append(float(np.logaddexp.reduce(forms)))
    mean = [np.logaddexp.reduce(names) - np.log(len(names)) for names in of_kind.values()]
    probability = dict(zip(of_kind, special.softmax(mean).tolist(), strict=True))
    return _sorted(probability)


def _sorted(probability: dict[str, float]) -> dict[str, float]:
    """The most probable first."""
    return dict(sorted(probability.items(), key=lambda one: -one[1]))


def right(view: View, file: AbstractVehicle) -> float:
    """The p-value of the free numbers' distance from the `file`'s, under the null that the file's are right (χ²)."""
    names = [row.name for row in view.vehicle.layout.free]
    own, theirs = view.vehicle.values(), file.values()
    at = [i for i, name in enumerate(names) if name in theirs]
    if not at:
        return 1.0
    away = np.array([float(theirs[names[i]]) - float(own[names[i]]) for i in at])
    chi_squared = away @ np.linalg.solve(view.covariance[np.ix_(at, at)], away)
    return float(special.chdtrc(len(at), max(float(chi_squared), 0.0)))
