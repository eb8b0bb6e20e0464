"""A small vehicle, recorded with and without a concealed effect: fast enough to diagnose in a test."""

from functools import cache

import jax.numpy as jnp
import numpy as np
from scipy.signal import lfilter

from jaxsub.effects import AbstractEffect, CrossflowDrag, HullAsymmetry, QuadraticDamping, SensorScale
from jaxsub.recording import Recording
from jaxsub.simulation.manoeuvres import prbs
from jaxsub.simulation.sampled import Sampled
from jaxsub.simulation.synthesis import integrate, synthetic
from jaxsub.vehicle import SubmergedBody
from jaxsub.vehicle.catalogue import dsrv

SAMPLES, INTERVAL = 300, 0.25
# a vocabulary whose programs are compiled in seconds, and by whichever test comes first for all of them
SMALL = (CrossflowDrag, HullAsymmetry, QuadraticDamping, SensorScale)


@cache
def wrong() -> SubmergedBody:
    """The DSRV with coefficients off by up to a fifth."""
    vehicle = dsrv()
    rng = np.random.default_rng(3)
    values = vehicle.values()
    free = [row.name for row in vehicle.layout.free]
    return vehicle.with_values({name: values[name] * (1.0 + 0.2 * rng.uniform(-1, 1)) for name in free})


def driven(seed: int) -> list[Recording]:
    """Three runs of growing deflections: at one amplitude a drag's growth with speed hides in the linear damping."""
    t = INTERVAL * np.arange(SAMPLES)
    grown = np.linspace(0.1, 0.6, SAMPLES)
    fins = [grown * prbs(SAMPLES, 12, 1.0, 100 * seed + i) for i in range(3)]
    return [Recording(f"run{i}", t, {"delta_s": fin}, "test") for i, fin in enumerate(fins)]


def recorded(effect: AbstractEffect | None, seed: int) -> tuple[Recording, ...]:
    """The runs of the true vehicle, by the continuous reference, with sensor noise."""
    vehicle = dsrv() if effect is None else dsrv().with_effect(effect)
    return tuple(synthetic(vehicle, driven(seed), seed=seed, states=integrate))


def disturbed(time: float, size: tuple[float, float], seed: int) -> tuple[Recording, ...]:
    """Nothing concealed; a Gauss-Markov heave force and pitch moment of a `size` (N, N m) and time constant."""
    rng, kept = np.random.default_rng(seed), np.exp(-INTERVAL / time)
    begun = rng.standard_normal((3, 1, 2))
    news = np.sqrt(1.0 - kept**2) * rng.standard_normal((3, SAMPLES - 1, 2))
    later, _ = lfilter([1.0], [1.0, -kept], news, axis=1, zi=kept * begun)
    force = np.asarray(size) * np.concatenate([begun, later], axis=1)
    push = jnp.asarray(np.stack([force[:, :-1], force[:, 1:]], axis=2))
    states = lambda vehicle, runs, start: Sampled.of(vehicle, runs).states(runs, start, push)
    return tuple(synthetic(dsrv(), driven(seed), seed=seed, states=states))
