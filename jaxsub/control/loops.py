"""One control loop, and the equation of one degree of freedom from which its gains follow."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..effects import VELOCITIES
from ..errors import InputError
from ..parameters import number
from ..programs import compiled
from ..simulation import at_rest
from ..vehicle import AbstractVehicle

# A fin that is not at a limit still differs from its demand by rounding, which must not stop the integral.
_AT_LIMIT = 1e-6


class Loop(eqx.Module):
    r"""$u = k_P\,\mathrm{clip}(e, \pm e_{max}) + h - k_D\,\dot y$, $\dot h = k_I e$; h stands still while u is cut off
    on the side to which h moves. Source: Åström and Hägglund (2006), §3.5.

    **Fields**

    - `proportional`, `integral`, `derivative`: gains, in units of the output by error, error·s and error/s.
    - `reach`: the largest error acted on: with the derivative it bounds the rate of approach.
    """

    proportional: Float[Array, ""]
    integral: Float[Array, ""]
    derivative: Float[Array, ""]
    reach: Float[Array, ""]

    @classmethod
    def of(cls, proportional: float, integral: float, derivative: float = 0.0, reach: float = np.inf) -> "Loop":
        """A loop of these gains."""
        return cls(*(number(float(value)) for value in (proportional, integral, derivative, reach)))

    def demand(self, error: Array, held: Array, rate: Array | float = 0.0) -> Float[Array, ""]:
        """The commanded output, before any limit; `held` is the integral."""
        return self.proportional * jnp.clip(error, -self.reach, self.reach) + held - self.derivative * rate

    def integrate(self, held: Array, error: Array, surplus: Array, dt: Array | float) -> Float[Array, ""]:
        """The integral `dt` s later; `surplus` is what was commanded and not given."""
        step = self.integral * jnp.clip(error, -self.reach, self.reach) * dt
        return jnp.where((jnp.abs(surplus) > _AT_LIMIT) & (step * surplus > 0.0), held, held + step)


class Axis(NamedTuple):
    r"""One turning degree of freedom about straight flight, $\dot\omega = a\omega + c\alpha + b\delta$.

    a is in 1/s, c and b in 1/s². Of the sizes (1/s) of the hull's eigenvalues in this plane, drift included,
    `swiftness` is the largest and `natural` the geometric mean; `growth` is the largest real part. `steady` is the rate
    (rad/s) at which a radian of deflection makes it go round.
    """

    a: float
    c: float
    b: float
    swiftness: float
    natural: float
    growth: float
    steady: float


def axis(
    vehicle: AbstractVehicle, plane: tuple[str, ...], angle: str, fins: dict[str, float], coefficient: str
) -> Axis:
    """The axis of the last equation of `plane`; its deflection moves each of `fins` by its sign.

    **Raises** `InputError` where the fins, by `coefficient`, turn nothing, or nothing damps the plane.
    """
    layout = vehicle.layout
    if angle not in layout.positions and layout.tells(angle):
        raise InputError(layout.name, "has its attitude as a quaternion", "delete model.attitude to fly an autopilot")
    by_state, by_fin = (np.asarray(part) for part in _derivatives(vehicle, at_rest(vehicle, 1)[0]))
    rows = [layout.equations.index(e) for e in plane if e in layout.equations]
    names = [name for name, _ in layout.inputs]
    damping = by_state[np.ix_(rows, rows)]
    force = by_fin[np.ix_(rows, [names.index(fin) for fin in fins])] @ np.array(list(fins.values()))
    stiffness = len(layout.equations) + layout.positions.index(angle) if angle in layout.positions else None
    if force[-1] == 0.0:
        remedy = f"give it {coefficient}, or fly it without this autopilot"
        raise InputError(f"{layout.name}: {' and '.join(fins)}", f"gives no {plane[-1]} moment", remedy)
    if np.linalg.matrix_rank(damping) < len(rows):
        what = f"nothing damps its {' and '.join(plane)}, so the autopilot has no time scale"
        raise InputError(layout.name, what, f"give it damping such as {coefficient[0]}_{VELOCITIES[plane[-1]]}")
    modes = np.linalg.eigvals(damping)
    return Axis(
        float(damping[-1, -1]),
        0.0 if stiffness is None else float(by_state[rows[-1], stiffness]),
        float(force[-1]),
        float(np.abs(modes).max()),
        float(np.abs(np.prod(modes)) ** (1.0 / len(modes))),
        float(np.real(modes).max()),
        float(-np.linalg.solve(damping, force)[-1]),
    )


@compiled
def _derivatives(
    vehicle: AbstractVehicle, state: Float[Array, " s"]
) -> tuple[Float[Array, "n s"], Float[Array, "n m"]]:
    """The acceleration's, by the state and by the signals, all of these zero."""
    neutral = jnp.zeros(len(vehicle.layout.held) + len(vehicle.layout.interpolated))
    return jax.jacfwd(vehicle.acceleration, (0, 1))(state, neutral)


def rate_loop(of: Axis, bandwidth: float, authority: float) -> Loop:
    r"""PI on the rate that puts both poles of $\dot\omega = a\omega + b\delta$ at -`bandwidth` (rad/s).

    A hull that is unstable on course overshoots any step, and is lost if that takes it past what its fins can hold.
    There the proportional part feels only a quarter of the reference, and an error commands `authority` rad at most.
    """
    gain = (2.0 * bandwidth + of.a) / of.b
    if of.growth < 0.0:
        return Loop.of(gain, bandwidth**2 / of.b)
    return Loop.of(0.25 * gain, bandwidth**2 / of.b, 0.75 * gain, abs(authority / (0.25 * gain)))


def angle_loop(of: Axis, bandwidth: float, authority: float) -> Loop:
    r"""PID on the angle that puts two poles of $\ddot\alpha = a\dot\alpha + c\alpha + b\delta$ at -`bandwidth` (rad/s)
    and one at a quarter of that. An error alone commands `authority` rad at most, which leaves fin for damping."""
    slow = bandwidth / 4.0
    derivative = (of.a + 2.0 * bandwidth + slow) / of.b
    proportional = (of.c + bandwidth**2 + 2.0 * bandwidth * slow) / of.b
    return Loop.of(proportional, slow * bandwidth**2 / of.b, derivative, abs(authority / proportional))
