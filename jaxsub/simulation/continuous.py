"""The continuous model between the samples of recordings: the reference for the sampled step, and a source of truth."""

from typing import TYPE_CHECKING, Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..programs import compiled
from ..recording.runs import Runs
from ..vehicle import AbstractVehicle
from ..vehicle.base import stack
from .sampled import parabola

if TYPE_CHECKING:
    import diffrax


class _Interval(eqx.Module):
    """The model on one sample interval, as arguments of its vector field."""

    vehicle: AbstractVehicle
    inverse: Float[Array, "n n"]
    nodes: Float[Array, "3 m"]
    length: Float[Array, ""]


def _rates(t: Any, state: Array, interval: _Interval) -> Array:
    vehicle, inverse = interval.vehicle, interval.inverse
    velocity = state[: inverse.shape[0]]
    motion = vehicle.motion(state, parabola(t / interval.length) @ interval.nodes)
    moved = stack(vehicle.position_rates(motion), vehicle.layout.positions, state[0])
    return jnp.concatenate([inverse @ (vehicle.force(motion) + vehicle.damping_matrix() @ velocity), moved])


@compiled
def integrate(
    vehicle: AbstractVehicle,
    runs: Runs,
    start: Float[Array, "r s"],
    *,
    rtol: float = 1e-9,
    atol: float = 1e-9,
    adjoint: "diffrax.AbstractAdjoint | None" = None,
) -> Float[Array, "r k s"]:
    r"""States (R, K, s) at the samples of `runs` of $\tilde M\dot\nu = \tilde A\nu + \tau$ of `vehicle`, SI.

    `start` (R, s) are the initial states, SI. Tsit5 with a step chosen by its error (`rtol`, `atol` in SI), restarted
    at every sample, so that no step spans a jump of a held input: there a step that did would be rejected again and
    again, and the time of the jump would have no derivative (diffrax issues 766 and 729). Inside an interval the
    signals follow the parabola through their values at its start, middle and end; `runs.substeps` plays no part. A run
    that diverges becomes NaN there and stays so, without an exception.

    The default `adjoint`, forward mode, gives `jax.jvp` and `jax.jacfwd`; for `jax.grad` pass
    `diffrax.RecursiveCheckpointAdjoint()`.

    Source: Tsitouras (2011), Comput. Math. Appl. 62; Kidger (2021), On Neural Differential Equations.
    """
    # imported here, since only this needs it and it takes long
    import diffrax

    inverse = jnp.linalg.inv(vehicle.mass_matrix())
    nodes = jax.vmap(vehicle.actuate)(runs.times, runs.nodes())
    controller = diffrax.PIDController(rtol=rtol, atol=atol)

    def advance(state: Array, interval: tuple[Array, Array, Array]) -> tuple[Array, Array]:
        node, length, live = interval
        # Where there is nothing to do the interval is empty, and diffrax returns the state itself at once.
        end = jnp.where(live & jnp.all(jnp.isfinite(state)), length, 0.0)
        solution = diffrax.diffeqsolve(
            diffrax.ODETerm(_rates),
            diffrax.Tsit5(),
            t0=0.0,
            t1=end,
            dt0=end,
            y0=state,
            args=_Interval(vehicle, inverse, node, length),
            stepsize_controller=controller,
            adjoint=diffrax.ForwardMode() if adjoint is None else adjoint,
            throw=False,
        )
        # where it gave up, diffrax returns how far it came: a state of an earlier time
        assert solution.ys is not None
        after = jnp.where(solution.result == diffrax.RESULTS.successful, solution.ys[-1], jnp.nan)
        return after, after

    def run(state: Array, node: Array, length: Array, live: Array) -> Array:
        return jnp.concatenate([state[None], jax.lax.scan(advance, state, (node, length, live))[1]])

    return jax.vmap(run)(start, nodes, runs.steps[runs.step_of], runs.live)
