"""What is swept: a body on recordings that it made itself, about coefficients that are off."""

import dataclasses

import jax.numpy as jnp
import numpy as np

from jaxsub.recording import Recording
from jaxsub.simulation import prbs, sampled_states, synthetic
from jaxsub.sweeps import Plan
from jaxsub.vehicle import AbstractVehicle
from jaxsub.vehicle.catalogue import dsrv, nps_auv_ii

_WRONG, _SPREAD, _SEED = 0.2, 0.5, 3


def plan(quick: bool, starts: int) -> Plan:
    """NPS AUV II in six degrees of freedom on two runs of 300 samples; `quick`, DSRV in its plane on two of 80."""
    truth = dsrv() if quick else nps_auv_ii()
    recordings = synthetic(
        truth, [_driven(truth, 80 if quick else 300, i) for i in range(2)], seed=_SEED, states=sampled_states
    )
    return Plan({truth.layout.name: _off(truth)}, {"two runs": recordings}, starts, spread=_SPREAD, seed=_SEED)


def _off(vehicle: AbstractVehicle) -> AbstractVehicle:
    rng, values = np.random.default_rng(_SEED), vehicle.values()
    share = {row.name: 1.0 + _WRONG * rng.uniform(-1.0, 1.0) for row in vehicle.layout.free}
    return vehicle.with_values({name: jnp.asarray(values[name] * factor) for name, factor in share.items()})


def _driven(vehicle: AbstractVehicle, samples: int, number: int) -> Recording:
    columns = {name: prbs(samples, 20, 0.2, 10 * number + i) for i, name in enumerate(vehicle.layout.held)}
    return Recording(f"run{number + 1}", 0.25 * np.arange(samples), columns, "sweep_scaling")


def longer(made: Plan, samples: int) -> Plan:
    """The plan on one run of another length, for what memory follows."""
    (vehicle,) = made.vehicles.values()
    run = synthetic(vehicle, [_driven(vehicle, samples, 0)], seed=_SEED, states=sampled_states)
    return dataclasses.replace(made, recordings={"one run": run})
