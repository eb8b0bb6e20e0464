"""A small vehicle, recorded with and without a concealed effect: fast enough to diagnose in a test."""

import json
from functools import cache

import jax.numpy as jnp
import numpy as np
from scipy.signal import lfilter

from jaxsub.discrepancy import Conclusions
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


def require_named(found: Conclusions, effect: AbstractEffect) -> None:
    """Named where it acts, within four standard errors, with the test run at the noise, as in the file of it."""
    assert found.verdict == "named"
    (physics,) = found.physics
    assert physics.effect == effect.name
    assert found.where[0].where in effect.where
    for estimate in physics.parameters.values():
        truth = float(getattr(effect, next(iter(effect.symbols()))))
        assert abs(estimate.value - truth) < 4.0 * estimate.standard_error
    before, after = (found.fit["held_out"][key] for key in ("baseline", "improved"))
    assert max(before.values()) > 1.2
    assert max(after.values()) < 1.15
    assert min(left.random for left in found.remains["baseline"].values()) < 1e-6
    for channel, left in found.remains["improved"].items():
        assert min(left.random, left.independent) > 1e-3
        assert left.low < after[channel] < left.high
    assert found.gain.ratio < 0.8 and found.gain.p_value < 0.05
    outcomes = {candidate.label: candidate.outcome for candidate in found.candidates}
    assert outcomes[physics.label] == "accepted"
    assert {outcomes[rival.label] for rival in physics.rivals if rival.label in outcomes} <= {"rival"}
    content = json.loads(json.dumps(found.to_json()))
    assert content["schema"] == 1 and content["physics"][0]["effect"] == effect.name
