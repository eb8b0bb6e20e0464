"""Accepted effects joined to the model, and everything fitted again."""

import dataclasses
from collections.abc import Sequence

import jax.numpy as jnp

from ..effects import AbstractEffect
from ..estimate import Fit, evaluate, search
from ..likelihood import Disturbance
from ..results import RESULTS
from ..vehicle import AbstractVehicle
from .view import View, look


def join(view: View, fit: Fit, effects: Sequence[AbstractEffect], disturbance: Disturbance) -> tuple[Fit, View]:
    """The view's vehicle with `effects`, which begin at their predicted numbers, and all of it fitted again."""
    vehicle = view.vehicle
    for effect in effects:
        vehicle = vehicle.with_effect(effect)
    return settle(fit, look(free_running(fit, vehicle), disturbance))


def settle(fit: Fit, view: View) -> tuple[Fit, View]:
    """The free-running fit of a view's vehicle, with the view's own covariance."""
    found = free_running(fit, view.vehicle)
    return dataclasses.replace(found, covariance=jnp.asarray(view.covariance), result=RESULTS.successful), view


def free_running(fit: Fit, vehicle: AbstractVehicle) -> Fit:
    """`vehicle` as it is on the runs of `fit`, from the initial states that suit it best."""
    _, start, sigma, cost, steps, result = search(vehicle, fit.runs, sigma=fit.sigma, moving=False)
    return evaluate(vehicle, fit.runs, start, sigma, cost=cost, steps=steps, result=result)
