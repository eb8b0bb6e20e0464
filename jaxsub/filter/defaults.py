"""Filters of a vehicle that know no more than its sensors' noise."""

from collections.abc import Callable

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..arrays import Values, namespace
from ..effects import CHANNEL_UNITS
from ..vehicle import AbstractVehicle
from ..vehicle.attitude import QUATERNION
from .ekf import AbstractFilter
from .mekf import ModifiedKalmanFilter
from .noise import ConstantNoise
from .vehicle import VehicleProcess

# Process noise per root second in sensors' sigmas. At four samples a second filter I then averages some eight samples.
# With much less it follows its model past the data, and filter II, which takes the state for corrected, corrects the
# parameters for the same error again and again; with much more the sensors' noise acts as a regressor and biases them.
DENSITY = 0.25
# noise of a small AUV's usual sensors, for a state that nothing measures
_USUAL = {"m/s": 0.01, "rad/s": 0.0035, "rad": 0.005, "m": 0.05}
_PARTNERS = dict(zip("uvwpqr", ("x", "y", "z", "phi", "theta", "psi"), strict=True))


def state_scale(vehicle: AbstractVehicle, sigma: Float[Values, " c"]) -> Float[Values, " s"]:
    """For each state of `vehicle` the noise of its channel in `sigma` (c,), SI; else that of its rate or its integral.

    Those are over a second; where there is none it is a usual size. A deviation of a number that differs by run has
    that between runs, none where it is not known.
    """
    layout = vehicle.layout
    plain = layout.plain
    measured = zip(layout.outputs, sigma, strict=True)
    known = {one.channel: size for one, size in measured if plain.get(one.channel) == one.column}
    if "depth" in known:
        known.setdefault("z", known["depth"])
    partner = _PARTNERS if layout.kind == "submerged-body" else {f"{e}_rate": e for e in layout.equations}
    partner = partner | {position: rate for rate, position in partner.items()}
    # the vector part of a quaternion is half an angle
    unit = lambda name: "rad" if name in QUATERNION else CHANNEL_UNITS.get(name, "")
    usual = lambda name: np.asarray(_USUAL.get(unit(name), 1.0))
    known |= {state: jnp.nan_to_num(vehicle.spreads[row.name]) for state, row in layout.deviations.items()}
    sizes = [known.get(n, known.get(partner.get(n, ""), usual(n))) for n in layout.states]
    return namespace(*sizes).stack(sizes)


def vehicle_filter(
    process: VehicleProcess, sigma: Float[Array, " c"], kind: Callable[..., AbstractFilter] = ModifiedKalmanFilter
) -> AbstractFilter:
    """A filter of `process` with sensors of noise `sigma` (c,), SI.

    The state's initial covariance and process noise are in terms of that noise. `kind` is the class of the filter.
    """
    scale = state_scale(process.vehicle, sigma)
    layout = process.vehicle.layout
    moving = jnp.array([name not in layout.deviations for name in layout.states])
    return kind(process, ConstantNoise(jnp.diag(DENSITY * scale * moving)), jnp.diag(sigma), jnp.diag(scale))
