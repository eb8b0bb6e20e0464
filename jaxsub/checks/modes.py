"""The vehicle's own modes: an unstable or much too fast baseline, and sampling that misses its fastest mode."""

from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..findings import Finding
from ..programs import compiled
from ..recording import Recording
from ..vehicle import AbstractVehicle
from .spans import amount

_UNSTABLE = 1.0  # e-folds in the longest run, below which an unstable mode is only noted
_SLOW = 1e-4  # 1/s: slower growth is rounding
_COARSE = 2.0  # sample intervals in the time constant of the fastest mode, upside down
_ABSURD = 1e4  # the same, beyond which a coefficient has a wrong unit


def modes(vehicle: AbstractVehicle, recordings: Sequence[Recording]) -> list[Finding]:
    r"""What the eigenvalues $\lambda$ of the model about rest at operating speed say of fitting it to `recordings`.

    A mode that grows by more than e in the longest run is a warning, since a simulation's error grows as fast, and
    so are sample intervals above $2/|\lambda|$.
    """
    if not recordings:
        return []
    layout = vehicle.layout
    matrix = np.asarray(_rates(vehicle, _mean_signals(vehicle, recordings)))
    if not np.all(np.isfinite(matrix)):
        return []
    values, vectors = np.linalg.eig(matrix)
    findings = []
    growth, longest = float(np.real(values).max()), max(recording.duration for recording in recordings)
    if growth > _SLOW:
        mode = np.abs(vectors[: len(layout.equations), int(np.argmax(np.real(values)))])
        name = layout.equations[int(np.argmax(mode))]
        severity = "warning" if growth * longest > _UNSTABLE else "note"
        what = f"is unstable in {name}: {growth:+.3g} 1/s, {amount(growth * longest)} e-folds in {amount(longest, 's')}"
        remedy = "check the signs of its coefficients, or use short runs" if severity == "warning" else ""
        findings.append(Finding("unstable", severity, layout.name, what, remedy))
    fastest = float(np.abs(values).max())
    coarsest = max(recordings, key=lambda recording: float(np.median(np.diff(recording.times))))
    step = float(np.median(np.diff(coarsest.times)))
    if fastest * step > _COARSE:
        rate = f"{amount(fastest * step)} times the sampling rate of {coarsest.source}"
        what = f"has a mode of {amount(fastest, '1/s')}, {rate}"
        remedy = "sample faster, or lock that motion"
        if fastest * step > _ABSURD:
            remedy = "check the units of masses and coefficients"
        findings.append(Finding("sampling", "warning", layout.name, what, remedy))
    return findings


def _mean_signals(vehicle: AbstractVehicle, recordings: Sequence[Recording]) -> Float[Array, " m"]:
    """Inputs at rest, surroundings at their mean."""
    layout = vehicle.layout
    surroundings = {column for _, column in layout.environment}
    columns = [*layout.held, *layout.interpolated]
    mean = lambda name: float(np.nanmean(np.concatenate([recording.columns[name] for recording in recordings])))
    values = [mean(name) if name in surroundings else 0.0 for name in columns]
    return jnp.asarray(np.array(values, jnp.result_type(float)))


@compiled
def _rates(vehicle: AbstractVehicle, signals: Float[Array, " m"]) -> Float[Array, "s s"]:
    """The derivative of the state's rate with respect to the state, about rest at operating speed."""
    layout = vehicle.layout
    count = len(layout.equations)

    def rates(state: Array) -> Array:
        moved = vehicle.position_rates(vehicle.motion(state, signals))
        positions = [jnp.broadcast_to(moved[name], ()) for name in layout.positions]
        return jnp.concatenate([vehicle.acceleration(state, signals), jnp.array(positions)])

    ahead = [vehicle.own_values()["speed"] if name == "u" else 0.0 for name in layout.states[:count]]
    return jax.jacfwd(rates)(jnp.array([*ahead, *[0.0] * len(layout.positions)], float))
