"""An oscillator that lacks effects: the fit without them, its examination, and models with some of the candidates."""

from functools import cache

import numpy as np
from rigs import driven, oscillator

from jaxsub.discrepancy.accept.acceptance import CandidateModels, Examination, Model, ModelFitter, fitted_model
from jaxsub.discrepancy.linearise.priors import with_wide_priors
from jaxsub.discrepancy.linearise.view import look
from jaxsub.discrepancy.search.examine import listed, weighed
from jaxsub.effects import AbstractEffect, CoulombFriction, CubicDamping, CubicStiffness, QuadraticDamping, SensorScale
from jaxsub.estimate import batch, fit
from jaxsub.simulation import synthetic

KINDS = (CoulombFriction, CubicDamping, CubicStiffness, QuadraticDamping, SensorScale)
DRAG, CUBIC, SPRING = "quadratic-damping[x]", "cubic-damping[x]", "cubic-stiffness[x]"
FILE = with_wide_priors(oscillator())
FITTER = ModelFitter(lambda message: None, FILE)


@cache
def lacking(drag: float, spring: float = 0.0) -> tuple[Model, Examination]:
    """The oscillator's fit to two runs of one with quadratic damping and a cubic spring, and its examination."""
    truth = oscillator().with_effect(QuadraticDamping("x", drag))
    truth = truth.with_effect(CubicStiffness("x", spring)) if spring else truth
    inputs = [driven(truth, 0.1 * np.arange(200), seed, amplitude=1.0) for seed in range(2)]
    found = fit(FILE, batch(FILE, synthetic(truth, inputs, seed=4)))
    view = look(found)
    return fitted_model(found, view, ()), weighed(view, listed(view, KINDS), lambda message: None)


@cache
def models(drag: float, spring: float = 0.0) -> CandidateModels:
    """Models with candidates of that examination, each fitted once for all tests."""
    base, found = lacking(drag, spring)
    return CandidateModels(FITTER.with_effects, base, found)


def numbers(found: Examination, *labels: str) -> list[int]:
    """The candidates of those labels."""
    known = [effect.label for effect in found.selector.candidates]
    return [known.index(label) for label in labels]


def labels(found: Examination, chosen: list[int]) -> list[str]:
    """Of some candidates, in their order."""
    effects: list[AbstractEffect] = found.selector.candidates
    return [effects[i].label for i in chosen]
