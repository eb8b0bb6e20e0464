"""A small vehicle, recorded with and without a concealed effect: fast enough to diagnose in a test."""

from functools import cache

import numpy as np

from jaxsub.effects import AbstractEffect
from jaxsub.recording import Recording
from jaxsub.simulate.manoeuvres import prbs
from jaxsub.simulate.synthetic import integrate, synthetic
from jaxsub.vehicle import SubmergedBody
from jaxsub.vehicle.catalogue import dsrv

SAMPLES, INTERVAL = 300, 0.25


@cache
def wrong() -> SubmergedBody:
    """The DSRV with coefficients off by up to a fifth."""
    vehicle = dsrv()
    rng = np.random.default_rng(3)
    values = vehicle.values()
    free = [row.name for row in vehicle.layout.free]
    return vehicle.with_values({name: values[name] * (1.0 + 0.2 * rng.uniform(-1, 1)) for name in free})


def recorded(effect: AbstractEffect | None, seed: int) -> tuple[Recording, ...]:
    """Three runs of the true vehicle, by the continuous reference, with sensor noise."""
    vehicle = dsrv() if effect is None else dsrv().with_effect(effect)
    t = INTERVAL * np.arange(SAMPLES)
    # growing deflections: at one amplitude a drag's growth with speed hides in the linear damping
    grown = np.linspace(0.1, 0.6, SAMPLES)
    driven = [
        Recording(f"run{i}", t, {"delta_s": grown * prbs(SAMPLES, 12, 1.0, 100 * seed + i)}, "test") for i in range(3)
    ]
    return tuple(synthetic(vehicle, driven, seed=seed, states=integrate))
