"""The catalogue's vehicles and three models of a user's own, and how each is driven in a trial."""

import dataclasses
from collections.abc import Callable
from types import UnionType

import numpy as np

from experiments.concealed_physics.bodies import INTERVAL, body, commands, start_state
from jaxsub.effects import AbstractActuator, TetherDrag
from jaxsub.vehicle import AbstractVehicle, catalogue, own_model

from . import drives
from .models import DoublePendulum, Motor, Tank


def _nothing(held: np.ndarray) -> np.ndarray:
    return np.zeros((len(held), 0))


@dataclasses.dataclass(frozen=True)
class Trial:
    """A vehicle, and how it is driven.

    **Fields**

    - `make()`: the vehicle. `samples` of `interval` s in each of `runs`, of which the last is held out.
    - `drive(run, samples, rng)`: commands of each input, (samples, inputs), SI; no two runs alike.
    - `start(vehicle, rng)`: the state at the start, (s,).
    - `prescribed(held)`: motions that the file prescribes by column (samples, c), SI, under these commands.
    """

    make: Callable[[], AbstractVehicle]
    samples: int
    drive: Callable[[int, int, np.random.Generator], np.ndarray]
    start: Callable[[AbstractVehicle, np.random.Generator], np.ndarray]
    interval: float = INTERVAL
    runs: int = 3
    prescribed: Callable[[np.ndarray], np.ndarray] = _nothing


def _from(**known: float | tuple[float, float]) -> Callable[[AbstractVehicle, np.random.Generator], np.ndarray]:
    """The state that is zero but for what is `known`, by name: a value, or between two."""

    def start(vehicle: AbstractVehicle, rng: np.random.Generator) -> np.ndarray:
        drawn = {name: rng.uniform(*at) if isinstance(at, tuple) else at for name, at in known.items()}
        return np.array([drawn.get(name, 0.0) for name in vehicle.layout.states])

    return start


def _without(make: Callable[[], AbstractVehicle], kinds: type | UnionType) -> AbstractVehicle:
    """A vehicle without its effects of those kinds, which the generator has in its own words."""
    vehicle = make()
    for label in [effect.label for effect in vehicle.effects if isinstance(effect, kinds)]:
        vehicle = vehicle.without_effect(label)
    ties = tuple(tie for tie in vehicle.layout.ties if "time_constant" not in tie.text)
    return dataclasses.replace(vehicle, layout=dataclasses.replace(vehicle.layout, ties=ties))


def _gliding(held: np.ndarray) -> np.ndarray:
    """Pitch and roll of a glider, rad: nose down while it is heavy."""
    return np.column_stack([0.4 * held[:, 0] / 2e-4, np.zeros(len(held))])


TRIALS = {
    "BlueROV2 Heavy": Trial(catalogue.bluerov2_heavy, 300, drives.rov, _from(z=(7.0, 9.0))),
    "KVLCC2": Trial(catalogue.kvlcc2, 600, drives.ship, _from(u=1.0, psi=(-3.0, 3.0))),
    "Otter": Trial(
        lambda: _without(catalogue.otter, AbstractActuator), 400, drives.catamaran, _from(u=1.0, psi=(-3.0, 3.0))
    ),
    "REMUS 100": Trial(catalogue.remus_100_nonlinear, 200, drives.auv, _from(u=1.54, z=10.0)),
    "NPS AUV II": Trial(
        lambda: body("nps"), 800, lambda run, samples, rng: commands("nps", run, samples, rng),
        lambda v, rng: start_state("nps", v, rng),
    ),
    "SUBOFF": Trial(catalogue.suboff, 75, drives.submarine, _from(u=3.3, z=20.0), runs=6),
    "Torpedo": Trial(
        lambda: _without(catalogue.torpedo, AbstractActuator), 400, drives.torpedo,
        _from(u=1.8, psi=(-3.0, 3.0), z=20.0),
    ),
    "RexROV": Trial(
        lambda: _without(catalogue.rexrov, AbstractActuator | TetherDrag), 400, drives.work_class, _from(z=(48.0, 52.0))
    ),
    "Seaglider": Trial(
        catalogue.seaglider, 400, drives.volume, _from(u=0.2, z=(20.0, 40.0)), interval=4.0, runs=6,
        prescribed=_gliding,
    ),
    "Slocum": Trial(catalogue.slocum, 600, drives.ballast, _from(u=0.3, z=(20.0, 40.0)), interval=1.0, runs=4),
    "Motor": Trial(
        lambda: own_model(Motor(R=2.0, L=0.1, k=0.5, J=0.02)), 400, drives.random(15, 0.0, 12.0), _from(),
        interval=0.02,
    ),
    "Tank": Trial(
        lambda: own_model(Tank(area=0.5, hole=1e-3)), 400, drives.random(20, 2e-3, 1.5e-3), _from(level=(0.1, 0.3)),
        interval=2.0,
    ),
    "Double pendulum": Trial(
        lambda: own_model(DoublePendulum(m=0.3, b=0.02)), 400, drives.random(15, 0.0, 0.6), _from(), interval=0.02
    ),
}  # fmt: skip
