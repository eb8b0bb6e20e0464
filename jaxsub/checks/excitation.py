"""Inputs that do not move in any run, and the coefficients that the runs therefore do not identify."""

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

_ZERO = 1e-9  # of a coefficient's largest effect


def idle_inputs(vehicle: AbstractVehicle, recordings: Sequence[Recording]) -> list[Finding]:
    """A warning for each input that has one value in all runs, with the free coefficients that act through it alone."""
    layout, findings = vehicle.layout, []
    for index, (name, column) in enumerate(layout.inputs):
        values = [recording.columns[column] for recording in recordings if column in recording.columns]
        if not values or max(float(part.max()) for part in values) > min(float(part.min()) for part in values):
            continue
        lost = _through(vehicle, index)
        # a constant acts too, but is indistinguishable from a constant force
        unidentified = f": these runs do not identify {', '.join(lost)}" if lost else ""
        what = f"the input {name} (column {column!r}) is {amount(float(values[0][0]))} in all runs{unidentified}"
        remedy = f"move {name}, or fix {'these coefficients' if lost else 'what acts through it'}"
        findings.append(Finding("input-at-rest", "warning", layout.name, what, remedy, column))
    return findings


def _through(vehicle: AbstractVehicle, index: int) -> list[str]:
    """The free coefficients that have an effect on acceleration only where input `index` is not zero."""
    layout = vehicle.layout
    names = [row.name for row in layout.free]
    if not names:
        return []
    draws = np.random.default_rng(0)
    state = jnp.asarray(draws.uniform(0.1, 0.5, len(layout.equations) + len(layout.positions)))
    signals = draws.uniform(0.1, 0.5, len(layout.held) + len(layout.interpolated))
    without = np.where(np.arange(len(signals)) == index, 0.0, signals)
    values = {name: vehicle.values()[name] for name in names}
    some, none = (np.abs(np.asarray(_effects(vehicle, values, state, jnp.asarray(s)))) for s in (signals, without))
    gone = (none.max(axis=0) <= _ZERO * some.max(axis=0)) & (some.max(axis=0) > 0.0)
    return [name for name, absent in zip(sorted(values), gone, strict=True) if absent]


@compiled
def _effects(
    vehicle: AbstractVehicle, values: dict[str, Array], state: Float[Array, " s"], signals: Float[Array, " m"]
) -> Float[Array, "n p"]:
    """Derivatives of acceleration with respect to the numbers `values`, in the order of their names."""
    by_name = jax.jacfwd(lambda numbers: vehicle.with_values(numbers).acceleration(state, signals))(values)
    return jnp.stack([by_name[name] for name in sorted(values)], axis=-1)
