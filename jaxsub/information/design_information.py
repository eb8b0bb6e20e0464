r"""What a run would tell about the free coefficients, before it is made.

With $S$ the sensitivities of all outputs, whitened by the sensors' noise, to changes of the coefficients relative to
their own sizes, and a coefficient known beforehand to $s_i$ of its size, a run leaves the covariance
$(S^TS + \mathrm{diag}(s_i^{-2}))^{-1}$ of the relative changes. $s_i = 1$ where no prior is given: what no run can tell
then counts alike for all of them, where it would make the determinant zero for all.
"""

import dataclasses

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..errors import InputError
from ..likelihood import Linearised, linearise_runs
from ..recording import Recording
from ..simulation import at_rest
from ..vehicle import AbstractVehicle
from .design_limits import producible, template

# of its size is how well a coefficient without a prior is known; rank.py calls what is known worse unknown
_KNOWN = 1.0


@dataclasses.dataclass(frozen=True)
class Information:
    """What a manoeuvre would tell, the initial state and the sensors' noise known.

    **Fields**

    - `names`: of the p free coefficients. `matrix`: (p, p) Fisher information of their relative changes.
    - `prior`: (p,) information on relative changes that is held beforehand.
    - `seconds`, `energy`: of the manoeuvre, as in `ManoeuvreLimits`.
    - `peaks`: the largest size of each channel that the vehicle can produce, SI.
    """

    names: tuple[str, ...]
    matrix: np.ndarray
    prior: np.ndarray
    seconds: float
    energy: float
    peaks: dict[str, float]

    @property
    def log_det(self) -> float:
        """ln det of the information, prior included."""
        return float(np.linalg.slogdet(self._posterior)[1])

    @property
    def standard_errors(self) -> dict[str, float]:
        """Relative standard errors that the run leaves."""
        errors = np.sqrt(np.diag(np.linalg.inv(self._posterior)))
        return dict(zip(self.names, errors.tolist(), strict=True))

    @property
    def least(self) -> float:
        """Information in the direction about which the run has least, prior included."""
        return float(np.linalg.eigvalsh(self._posterior)[0])

    @property
    def per_second(self) -> float:
        """Trace of the run's information over its length, 1/s."""
        return float(np.trace(self.matrix)) / self.seconds

    def gain(self, other: "Information") -> float:
        """The ratio of information on a coefficient to that of `other`, in the geometric mean (the D-criterion)."""
        return float(np.exp((self.log_det - other.log_det) / len(self.names)))

    @property
    def _posterior(self) -> np.ndarray:
        return self.matrix + np.diag(self.prior)


def information(vehicle: AbstractVehicle, recording: Recording) -> Information:
    """What `vehicle` driven `at_rest` by the inputs of `recording` would tell, every channel measured at every sample.

    **Raises** `InputError` for a vehicle without actuators or free coefficients, a channel whose noise is to be
    estimated, and an input column that is absent or has a gap.
    """
    require_designable(vehicle)
    runs = template(vehicle, [recording])
    model = linearise_runs(vehicle, runs, at_rest(vehicle, 1))
    S = np.asarray(sensitivities(vehicle, model))
    shown = vehicle.channels(vehicle.motion(model.states[0], runs.signals[0]))
    inputs = np.asarray(runs.signals[0, :-1, : len(vehicle.layout.held)])
    return Information(
        tuple(row.name for row in vehicle.layout.free),
        S.T @ S,
        np.asarray(prior_root(vehicle)) ** 2,
        recording.duration,
        float(np.diff(recording.times) @ np.sum(inputs**2, axis=1)),
        {name: float(jnp.max(jnp.abs(shown[name]))) for name in producible(vehicle)},
    )


def log_det(vehicle: AbstractVehicle, model: Linearised) -> Float[Array, ""]:
    """ln det of the information of runs that `vehicle` is linearised along, prior included; it has a gradient."""
    # by QR, which keeps the half of the digits that forming the information would lose
    R = jnp.linalg.qr(jnp.concatenate([sensitivities(vehicle, model), jnp.diag(prior_root(vehicle))]), mode="r")
    return 2.0 * jnp.sum(jnp.log(jnp.abs(jnp.diagonal(R))))


def sensitivities(vehicle: AbstractVehicle, model: Linearised) -> Float[Array, "n p"]:
    """Whitened sensitivities of all outputs to relative changes of the free coefficients."""
    sigma = jnp.asarray([output.sigma for output in vehicle.layout.outputs])
    return (model.theta * _sizes(vehicle) / sigma[:, None]).reshape(-1, model.theta.shape[-1])


def prior_root(vehicle: AbstractVehicle) -> Float[Array, " p"]:
    """1 / standard deviation of each free coefficient before the run, in its own size."""
    spread = jnp.asarray([row.prior_std for row in vehicle.layout.free])
    return jnp.where(jnp.isfinite(spread), _sizes(vehicle) / spread, 1.0 / _KNOWN)


def require_designable(vehicle: AbstractVehicle) -> None:
    """Raise `InputError` unless `vehicle` has actuators, free coefficients and sensors of known noise."""
    layout = vehicle.layout
    where = f"vehicle {layout.name!r}"
    if not layout.held:
        raise InputError(where, "has no actuator", "a manoeuvre moves one")
    if not layout.free:
        raise InputError(where, "has no free coefficient", "free those that the manoeuvre is to identify")
    for output in layout.outputs:
        if output.sigma is None:
            what = f"the noise of {output.name!r} is to be estimated"
            raise InputError(where, what, "give its sigma: manoeuvres are weighed by it")


def _sizes(vehicle: AbstractVehicle) -> Float[Array, " p"]:
    values = vehicle.values()
    theta = jnp.stack([values[row.name] for row in vehicle.layout.free])
    return jnp.where(theta == 0.0, 1.0, jnp.abs(theta))
