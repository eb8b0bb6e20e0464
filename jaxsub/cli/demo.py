"""`jaxsub demo`: recordings that conceal an effect, and the whole path on them."""

from pathlib import Path

import numpy as np

from ..effects import AbstractEffect
from ..effects.actuators import ActuatorLag
from ..effects.hull import CoriolisCoupling, CrossflowDrag, HullAsymmetry, TurningSpeedLoss
from ..effects.hydrostatics import TrimOffset
from ..effects.sensors import SensorBias, SensorScale
from ..parameters import number
from ..recording import Recording, save
from ..simulation import sampled_states, synthetic
from ..simulation.manoeuvres import prbs
from ..vehicle import AbstractVehicle, read_vehicle, write_vehicle
from ..vehicle.catalogue import nps_auv_ii
from . import session, terminal
from .diagnose import answered, emit
from .output import fresh_folder
from .runs import load_runs

_SAMPLES, _INTERVAL, _RUNS = 800, 0.2, 3
_WRONG = 0.2


def concealable(vehicle: AbstractVehicle) -> list[AbstractEffect]:
    """Effects large enough to matter to an operator, and different enough to be distinguished in these runs."""
    layout = vehicle.layout
    effects: list[AbstractEffect] = [
        CrossflowDrag("horizontal", layout.length, layout.diameter, number(0.7)),
        ActuatorLag("rudder", number(0.6)),
        SensorScale("r", number(0.06)),
        CoriolisCoupling(layout.equations, number(1.0)),
        TurningSpeedLoss("yaw", "yaw", number(-6000.0)),
        SensorBias("q", number(0.0012)),
        HullAsymmetry("yaw", number(12.0)),
        TrimOffset("z", number(0.03)),
    ]
    return effects


def run(out: Path, seed: int, overwrite: bool) -> None:
    """Conceal an effect chosen by `seed` in recordings, then diagnose them from their files like a user's own."""
    session.start()
    with fresh_folder(out, overwrite) as folder:
        concealed = make_files(folder, seed)
        vehicle = read_vehicle(folder / "vehicle.toml")
        runs = load_runs(sorted(folder.glob("run*.csv")), vehicle)
        answer = answered(vehicle, runs[:-1], runs[-1:])
        emit(answer)
        answer.write(folder)
    terminal.note(f"report: {out / 'report.html'}")
    if concealed is not None:
        terminal.note(f"concealed was: {concealed.label}")


def make_files(folder: Path, seed: int, *chosen: AbstractEffect | None) -> AbstractEffect | None:
    """Write `vehicle.toml`, whose coefficients are up to 20 % off, and recordings of the true vehicle.

    Returns what the recordings conceal: the effect (or None) given last, else one that `seed` chooses.
    """
    rng = np.random.default_rng(seed)
    vehicle = nps_auv_ii()
    choices = concealable(vehicle)
    drawn = choices[seed % len(choices)]
    effect = chosen[0] if chosen else drawn
    values = vehicle.values()
    free = [row.name for row in vehicle.layout.free]
    guess = vehicle.with_values({name: values[name] * (1.0 + _WRONG * rng.uniform(-1.0, 1.0)) for name in free})
    write_vehicle(guess, folder / "vehicle.toml", "NPS AUV II with coefficients up to 20 % off: where a user starts")
    driven = [inputs(number, rng) for number in range(_RUNS)]
    truth = vehicle if effect is None else vehicle.with_effect(effect)
    for recording in synthetic(truth, driven, seed=seed, states=sampled_states):
        save(recording, folder / f"{recording.name}.csv", units={"r": "deg/s", "q": "deg/s", "p": "deg/s"})
    return effect


def inputs(number: int, rng: np.random.Generator) -> Recording:
    """Rudder and elevators in pseudo-random sequences, as the field excites a body whose coefficients it wants."""
    t = _INTERVAL * np.arange(_SAMPLES)
    holds, sizes = (25, 20, 20), (0.25, 0.12, 0.12)
    names = ("delta_r", "delta_er", "delta_el")
    seeds = rng.integers(2**31, size=3)
    columns = {n: prbs(_SAMPLES, h, a, int(s)) for n, h, a, s in zip(names, holds, sizes, seeds, strict=True)}
    return Recording(f"run{number + 1}", t, columns, "demo")
