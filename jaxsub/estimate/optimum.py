"""What is said of the end of a search: how sure its estimates are, and whether it is an optimum."""

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from ..programs import compiled
from ..results import RESULTS
from ..vehicle import AbstractVehicle
from .coordinates import Coordinates
from .curvature import decoupled

# standard errors from an optimum that is none
_MATTERS = 0.1


@compiled
def inertia(vehicle: AbstractVehicle) -> Float[Array, "n n"]:
    """The inertia of a `vehicle` and of the water that moves with it, in its n equations, SI."""
    return jnp.asarray(vehicle.mass_matrix())


@compiled
def statistics_at_end(
    space: Coordinates, at: Array, inertia: Array, products: Float[Array, "r q q"], result: RESULTS
) -> tuple[Array, Array, Array, RESULTS]:
    """Covariance of the free parameters, gradient in standard errors, bound that each presses on, judged `result`.

    Where a search in `space` ended at the parameters `at` (p,), SI, with the `inertia` (n, n) there; `products`
    (R, q, q) are those of `BlockLinearised`.
    """
    information, gradient = information_matrix(space, at, products)
    lower, upper = space.transform.lower, space.transform.upper
    room = jnp.where(gradient > 0.0, upper - at, at - lower)
    away = standard_errors_away(information, gradient, room)
    pressed = jnp.where(is_pressed(information, room), jnp.sign(gradient), 0.0)
    # others' errors are for what presses on a bound held there; its own is the curvature's, which is no interval
    covariance = inverse_information(decoupled(information, pressed != 0.0))
    own = inverse_information(information)
    covariance = jnp.where(jnp.diag(pressed != 0.0), own, covariance)
    farthest = jnp.max(away, initial=0.0)
    return covariance, farthest, pressed, judged(inertia, farthest, result)


def inverse_information(information: Float[Array, "p p"]) -> Float[Array, "p p"]:
    """The covariance that the information allows: a direction without any gets no false certainty elsewhere."""
    size = jnp.sqrt(jnp.maximum(jnp.diag(information), 1e-300))
    # a pseudo-inverse in equilibrated coordinates
    values, vectors = jnp.linalg.eigh(information / jnp.outer(size, size))
    inverse = (vectors / jnp.maximum(values, 1e-14)) @ vectors.T
    return inverse / jnp.outer(size, size)


def standard_errors_away(
    information: Float[Array, "p p"], gradient: Float[Array, " p"], room: Float[Array, " p"]
) -> Float[Array, " p"]:
    """How many standard errors a Newton step from here would move each parameter, no further than bounds allow.

    What presses on a bound, with less `room` downhill than matters, stays.
    """
    pressed = is_pressed(information, room)
    covariance = inverse_information(decoupled(information, pressed))
    step = jnp.abs(covariance @ jnp.where(pressed, 0.0, gradient))
    return step / jnp.sqrt(jnp.maximum(jnp.diag(covariance), 1e-300))


def is_pressed(information: Float[Array, "p p"], room: Float[Array, " p"]) -> Bool[Array, " p"]:
    """Which parameters have less `room` downhill than matters beside their standard errors, others known."""
    return room * jnp.sqrt(jnp.diag(information)) < _MATTERS


def judged(inertia: Float[Array, "n n"], away: Float[Array, ""], result: RESULTS) -> RESULTS:
    """`result`, unless the `inertia` is not positive definite or the end is 0.1 standard errors off an optimum."""
    definite = jnp.all(jnp.linalg.eigvalsh(0.5 * (inertia + inertia.T)) > 0.0)
    result = RESULTS.where((result == RESULTS.successful) & ~(away < _MATTERS), RESULTS.not_stationary, result)
    return RESULTS.where(definite, result, RESULTS.indefinite_inertia)


def information_matrix(
    space: Coordinates, at: Float[Array, " p"], products: Float[Array, "r q q"]
) -> tuple[Float[Array, "p p"], Float[Array, " p"]]:
    r"""Fisher information of the free parameters (physical units) with the initial states eliminated, and the gradient.

    $I = \sum_r J_\theta^T J_\theta - J_\theta^T J_x (J_x^T J_x + 1)^{-1} J_x^T J_\theta$ plus the prior's, with $J_x$
    by initial states in units of their spread, so that a known one, which has none, drops out. Of the coordinates
    `space`, with the parameters `at` (p,), SI, and `products` (R, q, q) of `BlockLinearised`.
    """
    p = len(space.prior_mean)
    own = products[:, p:-1, p:-1] + jnp.eye(len(space.start_std))
    mixed = products[:, :p, p:-1]
    gain = jnp.linalg.solve(own, jnp.swapaxes(mixed, 1, 2))
    information = jnp.sum(products[:, :p, :p] - mixed @ gain, 0) + jnp.diag(space.prior_std**-2.0)
    pull = (at - space.prior_mean) / space.prior_std**2
    return information, jnp.sum(products[:, :p, -1], axis=0) - pull
