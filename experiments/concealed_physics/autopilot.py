"""An autopilot of heading, depth, speed and roll: proportional and rate feedback of what the sensors show."""

import jax.numpy as jnp
import numpy as np
from jax import Array

from .bodies import CRUISE_SHAFT, INTERVAL, LARGEST_RUDDER

# of course (rad), depth (m), speed (m/s) and roll (rad): least and most seconds between steps, and largest step
_STEPS = ((14.0, 26.0, 0.6), (20.0, 36.0, 2.0), (25.0, 45.0, 0.3), (8.0, 16.0, 0.12))
_LARGEST_ELEVATOR, _LARGEST_PITCH = 0.3, 0.25


def references(start: dict[str, float], share: float, samples: int, rng: np.random.Generator) -> np.ndarray:
    """Course, depth, speed and roll to keep, (samples, 4): steps at random times about those of `start`.

    Those of depth are a `share` of what they are in deep water.
    """
    t = INTERVAL * np.arange(samples)
    columns = []
    for least, most, largest in _STEPS:
        edges = np.cumsum(rng.uniform(least, most, int(t[-1] / least) + 1))
        levels = largest * rng.uniform(0.3, 1.0, len(edges) + 1) * rng.choice([-1.0, 1.0], len(edges) + 1)
        columns.append(levels[np.searchsorted(edges, t, side="right")])
    course, depth, speed, roll = columns
    return np.stack([start["psi"] + course, start["z"] + share * depth, start["u"] + speed, roll], axis=1)


def command(wanted: Array, shown: dict[str, Array]) -> Array:
    """Rudder, elevators and shaft speed (rad, rad/s) for the reference `wanted` (4,) and the channels `shown`.

    A positive rudder turns to port, a positive elevator noses down, and more on the right than on the left heels to
    port, so that each counteracts an error and its rate of the same sign.
    """
    off = jnp.arctan2(jnp.sin(shown["psi"] - wanted[0]), jnp.cos(shown["psi"] - wanted[0]))
    rudder = jnp.clip(off + 2.0 * shown["r"], -LARGEST_RUDDER, LARGEST_RUDDER)
    pitch = jnp.clip(0.1 * (shown["z"] - wanted[1]), -_LARGEST_PITCH, _LARGEST_PITCH)
    dive = shown["theta"] - pitch + 2.0 * shown["q"]
    # righting moments are strong, and only a firm hand shakes roll
    apart = 2.0 * (shown["phi"] - wanted[3]) + shown["p"]
    right, left = (jnp.clip(e, -_LARGEST_ELEVATOR, _LARGEST_ELEVATOR) for e in (dive + apart, dive - apart))
    shaft = CRUISE_SHAFT * jnp.clip(1.0 + wanted[2] - shown["u"], 0.5, 1.5)
    return jnp.stack([rudder, right, left, shaft])
