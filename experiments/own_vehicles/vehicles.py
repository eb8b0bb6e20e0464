"""The catalogue's vehicles, and the commands that their users would give them in a trial."""

import dataclasses
import math
from collections.abc import Callable

import numpy as np

from experiments.concealed_physics.bodies import INTERVAL, body, commands, start_state
from jaxsub.simulation.manoeuvres import square
from jaxsub.vehicle import AbstractVehicle
from jaxsub.vehicle.catalogue import bluerov2_heavy, kvlcc2, otter, remus_100_nonlinear


@dataclasses.dataclass(frozen=True)
class Trial:
    """A vehicle, and how it is driven.

    **Fields**

    - `make()`: the vehicle of the catalogue. `samples` of `INTERVAL` s in each run.
    - `drive(run, samples, rng)`: commands of each input, (samples, inputs), SI; no two runs alike.
    - `start(vehicle, rng)`: the state at the start, (s,).
    """

    make: Callable[[], AbstractVehicle]
    samples: int
    drive: Callable[[int, int, np.random.Generator], np.ndarray]
    start: Callable[[AbstractVehicle, np.random.Generator], np.ndarray]


def _levels(samples: int, hold: int, largest: float, rng: np.random.Generator) -> np.ndarray:
    """A command of random levels, each held for `hold` samples and more."""
    levels = np.zeros(samples)
    at = 0
    while at < samples:
        length = int(rng.integers(hold, 3 * hold))
        levels[at : at + length] = rng.uniform(-largest, largest)
        at += length
    return levels


def _at(vehicle: AbstractVehicle, **known: float) -> np.ndarray:
    """The state that is zero but for what is `known`, by name."""
    return np.array([known.get(name, 0.0) for name in vehicle.layout.states])


def _rov(run: int, samples: int, rng: np.random.Generator) -> np.ndarray:
    """Demands ahead, across, down and of turning, given to eight thrusters; each has a little of its own too.

    Nobody holds it upright, so they are small enough for its weight to do so.
    """
    ahead, across, turn = (_levels(samples, 15, size, rng) for size in (0.15, 0.15, 0.1))
    level = [ahead - across - turn, ahead + across + turn, -ahead - across + turn, -ahead + across - turn]
    upright = [-_levels(samples, 25, 0.2, rng)] * 4
    own = [_levels(samples, 10, size, rng) for size in (*[0.04] * 4, *[0.015] * 4)]
    return np.stack([*level, *upright], 1) + np.stack(own, 1)


def _ship(run: int, samples: int, rng: np.random.Generator) -> np.ndarray:
    """A zigzag, a circle and random rudder, at shaft speeds of several levels."""
    t = INTERVAL * np.arange(samples)
    rudder = (
        square(t, rng.uniform(22.0, 34.0), rng.uniform(0.2, 0.5)),
        square(t, rng.uniform(60.0, 80.0), rng.uniform(0.3, 0.5)),
        _levels(samples, 20, 0.5, rng),
    )[run % 3]
    return np.stack([rudder, 2.0 * math.pi * (10.4 + _levels(samples, 90, 3.0, rng))], 1)


def _catamaran(run: int, samples: int, rng: np.random.Generator) -> np.ndarray:
    """Both shaft speeds, ahead with turns."""
    ahead = 50.0 + _levels(samples, 40, 30.0, rng)
    turn = _levels(samples, 12, 25.0, rng)
    return np.stack([ahead + turn, ahead - turn], 1)


def _torpedo(run: int, samples: int, rng: np.random.Generator) -> np.ndarray:
    """Both planes of fins, small and fast enough to keep a hull that is not stable near its course."""
    return np.stack([_levels(samples, 8, 0.12, rng), _levels(samples, 8, 0.06, rng)], 1)


def _bare_otter() -> AbstractVehicle:
    """Otter without the lags of its shafts, which the generator has in its own words."""
    vehicle = otter()
    for name in ("left", "right"):
        vehicle = vehicle.without_effect(f"actuator-lag[{name}]")
    return dataclasses.replace(vehicle, layout=_untied(vehicle.layout))


def _untied(layout):
    """The layout without ties to lags that are gone."""
    return dataclasses.replace(layout, ties=tuple(tie for tie in layout.ties if "time_constant" not in tie.text))


TRIALS = {
    "BlueROV2 Heavy": Trial(bluerov2_heavy, 300, _rov, lambda v, rng: _at(v, z=8.0 + rng.uniform(-1.0, 1.0))),
    "KVLCC2": Trial(kvlcc2, 600, _ship, lambda v, rng: _at(v, u=1.0, psi=rng.uniform(-3.0, 3.0))),
    "Otter": Trial(_bare_otter, 400, _catamaran, lambda v, rng: _at(v, u=1.0, psi=rng.uniform(-3.0, 3.0))),
    "REMUS 100": Trial(remus_100_nonlinear, 200, _torpedo, lambda v, rng: _at(v, u=1.54, z=10.0)),
    "NPS AUV II": Trial(
        lambda: body("nps"), 800, lambda run, samples, rng: commands("nps", run, samples, rng),
        lambda v, rng: start_state("nps", v, rng),
    ),
}  # fmt: skip
