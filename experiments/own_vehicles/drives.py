"""The commands that owners would give their vehicles in a trial, (samples, inputs), SI; no two runs alike."""

import math

import numpy as np
from scipy.ndimage import uniform_filter1d

from experiments.concealed_physics.bodies import INTERVAL
from jaxsub.simulation.manoeuvres import square


def levels(samples: int, hold: int, largest: float, rng: np.random.Generator) -> np.ndarray:
    """A command of random levels, each held for `hold` samples and more."""
    found = np.zeros(samples)
    at = 0
    while at < samples:
        length = int(rng.integers(hold, 3 * hold))
        found[at : at + length] = rng.uniform(-largest, largest)
        at += length
    return found


def level_thrusters(ahead: np.ndarray, across: np.ndarray, turn: np.ndarray) -> list[np.ndarray]:
    """Demands ahead, across and of turning for four thrusters at the corners of an ROV, each turned by 45°."""
    return [ahead - across - turn, ahead + across + turn, -ahead - across + turn, -ahead + across - turn]


def rov(run: int, samples: int, rng: np.random.Generator) -> np.ndarray:
    """Demands ahead, across, down and of turning, given to eight thrusters; each has a little of its own too.

    Nobody holds it upright, so they are small enough for its weight to do so.
    """
    ahead, across, turn = (levels(samples, 15, size, rng) for size in (0.15, 0.15, 0.1))
    level = level_thrusters(ahead, across, turn)
    upright = [-levels(samples, 25, 0.2, rng)] * 4
    own = [levels(samples, 10, size, rng) for size in (*[0.04] * 4, *[0.015] * 4)]
    return np.stack([*level, *upright], 1) + np.stack(own, 1)


def ship(run: int, samples: int, rng: np.random.Generator) -> np.ndarray:
    """A zigzag, a circle and random rudder, at shaft speeds of several levels."""
    t = INTERVAL * np.arange(samples)
    rudder = (
        square(t, rng.uniform(22.0, 34.0), rng.uniform(0.2, 0.5)),
        square(t, rng.uniform(60.0, 80.0), rng.uniform(0.3, 0.5)),
        levels(samples, 20, 0.5, rng),
    )[run % 3]
    return np.stack([rudder, 2.0 * math.pi * (10.4 + levels(samples, 90, 3.0, rng))], 1)


def catamaran(run: int, samples: int, rng: np.random.Generator) -> np.ndarray:
    """Both shaft speeds, ahead with turns."""
    ahead = 50.0 + levels(samples, 40, 30.0, rng)
    turn = levels(samples, 12, 25.0, rng)
    return np.stack([ahead + turn, ahead - turn], 1)


def auv(run: int, samples: int, rng: np.random.Generator) -> np.ndarray:
    """Both planes of fins, small and fast enough to keep a hull that is not stable near its course."""
    return np.stack([levels(samples, 8, 0.12, rng), levels(samples, 8, 0.06, rng)], 1)


def submarine(run: int, samples: int, rng: np.random.Generator) -> np.ndarray:
    """A stern plane that is small and fast, since the hull is not stable, and a thrust near that of its speed."""
    return np.stack([levels(samples, 4, 0.04, rng), 123.0 + levels(samples, 20, 40.0, rng)], 1)


def torpedo(run: int, samples: int, rng: np.random.Generator) -> np.ndarray:
    """Four fins, opposite ones together but for a little, and a propeller at several speeds."""
    turn, dive = (levels(samples, 10, size, rng) for size in (0.15, 0.08))
    fins = np.stack([turn, -turn, dive, -dive], 1) + np.stack([levels(samples, 8, 0.01, rng) for _ in range(4)], 1)
    return np.column_stack([fins, 125.0 + levels(samples, 40, 20.0, rng)])


def work_class(run: int, samples: int, rng: np.random.Generator) -> np.ndarray:
    """Rotor speeds: four rotors hold an ROV down that is too light, four push it ahead, across and round."""
    ahead, across, turn = (levels(samples, 15, size, rng) for size in (500.0, 400.0, 250.0))
    down = [-480.0 + levels(samples, 25, 80.0, rng)] * 4
    level = level_thrusters(ahead, across, turn)
    own = [levels(samples, 10, 20.0, rng) for _ in range(8)]
    return np.stack([*down, *level], 1) + np.stack(own, 1)


def dives(samples: int, rng: np.random.Generator) -> np.ndarray:
    """-1 while a glider goes down, 1 while it goes up, and not as fast each time; over eight samples from one to the
    next."""
    leg = samples // 4
    each = np.repeat([-1.0, 1.0, -1.0, 1.0, 1.0], leg)[:samples] * np.repeat(rng.uniform(0.6, 1.0, 5), leg)[:samples]
    return uniform_filter1d(each, 8)


def volume(run: int, samples: int, rng: np.random.Generator) -> np.ndarray:
    """The volume that a glider's engine displaces, m³: 0.2 l and less."""
    return 2e-4 * dives(samples, rng)[:, None]


def ballast(run: int, samples: int, rng: np.random.Generator) -> np.ndarray:
    """A glider's ballast, heavy to go down (kg), and its battery, forward to go down (m)."""
    down = -dives(samples, rng)
    return np.stack([0.25 * down, 0.03 * down + levels(samples, 25, 0.004, rng)], 1)


def random(hold: int, middle: float, largest: float):
    """One input of random levels about a middle."""
    return lambda run, samples, rng: (middle + levels(samples, hold, largest, rng))[:, None]
