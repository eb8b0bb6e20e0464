"""The case that every peer fits: NPS AUV II, 25 free coefficients 20 % off, three runs of 800 samples of 10 channels.

All that a peer needs is here as plain numbers; a peer sees nothing of this library.
"""

import dataclasses

import jax.numpy as jnp
import numpy as np

from jaxsub.cli.demo import inputs
from jaxsub.estimate import Problem, batch
from jaxsub.recording import Recording
from jaxsub.simulation import at_rest, sampled_states, synthetic
from jaxsub.vehicle import AbstractVehicle
from jaxsub.vehicle.catalogue import nps_auv_ii

SEED, WRONG = 7, 0.2
# what inertia is free beside the 21 coefficients of damping and control; a prior holds it as a panel code would
ADDED = ("Y_vdot", "Z_wdot", "M_qdot", "N_rdot")
_PRIOR = 0.05
# m/s off the operating speed at the start of successive runs: without it surge drag and thrust are one
_SPEEDS = (-0.4, 0.3, -0.2)


@dataclasses.dataclass(frozen=True)
class Case:
    """A problem as a peer gets it: R runs of K samples, m fins, c channels that are the states, p free coefficients.

    **Fields**

    - `values`: every number of the body, SI, those of `names` at the start of the search. `truth`: (p,).
    - `interval`: s between samples. `fins`: (R, K, m) rad, held. `measured`: (R, K, c). `sigma`: (c,).
    - `guess`, `spread`: (R, c), (c,) the Gaussian prior of the initial states.
    - `prior_mean`, `prior_std`: (p,), the latter infinite where there is none.
    """

    values: dict[str, float]
    names: tuple[str, ...]
    truth: np.ndarray
    interval: float
    fins: np.ndarray
    measured: np.ndarray
    sigma: np.ndarray
    guess: np.ndarray
    spread: np.ndarray
    prior_mean: np.ndarray
    prior_std: np.ndarray

    @property
    def centre(self) -> np.ndarray:
        """(p,) free coefficients at the start of the search."""
        return np.array([self.values[name] for name in self.names])

    @property
    def size(self) -> int:
        """Coordinates of the search: coefficients in their own size, and initial states in their spread."""
        return len(self.names) + self.guess.size


def vehicle_and_recordings(
    samples: int = 800, runs: int = 3, free: int = 25
) -> tuple[AbstractVehicle, AbstractVehicle, list[Recording]]:
    """The true vehicle, the one that is `WRONG`, and what the true one recorded."""
    rng = np.random.default_rng(SEED)
    true = _with_free(nps_auv_ii(), free)
    driven = []
    for index in range(runs):
        whole = inputs(index, rng)
        repeats = -(-samples // len(whole.times))
        columns = {name: np.tile(column, repeats)[:samples] for name, column in whole.columns.items()}
        step = whole.times[1] - whole.times[0]
        driven.append(Recording(whole.name, step * np.arange(samples), columns, "benchmark"))
    start = at_rest(true, runs).at[:, 0].add(jnp.asarray(np.resize(_SPEEDS, runs)))
    recorded = synthetic(true, driven, seed=SEED, start=start, states=sampled_states)
    values, off = true.values(), rng.uniform(-WRONG, WRONG, len(true.layout.free))
    moved = {
        row.name: values[row.name] * (1.0 + by)
        for row, by in zip(true.layout.free, off, strict=True)
        if row.name not in ADDED
    }
    return true, true.with_values(moved), recorded


def problem_and_case(samples: int = 800, runs: int = 3, free: int = 25) -> tuple[Problem, Case]:
    """The problem as this library takes it, and as a peer does."""
    true, vehicle, recorded = vehicle_and_recordings(samples, runs, free)
    sigma = jnp.array([output.sigma for output in vehicle.layout.outputs])
    stacked = batch(vehicle, recorded)
    assert stacked.substeps == 1
    problem = Problem.of(vehicle, stacked, sigma)
    names = tuple(row.name for row in vehicle.layout.free)
    right = true.values()
    case = Case(
        {name: float(value) for name, value in vehicle.values().items()},
        names,
        np.array([float(right[name]) for name in names]),
        float(stacked.steps[0]),
        np.asarray(stacked.signals),
        np.asarray(stacked.outputs),
        np.asarray(sigma),
        np.asarray(problem.guess),
        np.asarray(problem.start_std),
        np.asarray(problem.prior_mean),
        np.asarray(problem.prior_std),
    )
    return problem, case


def _with_free(vehicle: AbstractVehicle, count: int) -> AbstractVehicle:
    """`vehicle` with the first `count` of its damping and control coefficients, and then of the inertia, free."""
    listed = [row.name for row in vehicle.layout.free] + list(ADDED)
    chosen = set(listed[:count])
    rows = tuple(
        dataclasses.replace(
            row,
            free=row.name in chosen,
            prior_std=_PRIOR * abs(row.prior_mean) if row.name in ADDED else row.prior_std,
        )
        for row in vehicle.layout.parameters
    )
    return dataclasses.replace(vehicle, layout=dataclasses.replace(vehicle.layout, parameters=rows))
