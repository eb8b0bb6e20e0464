"""The two scenarios from which the manoeuvring paper estimates its coefficients (its section 6)."""

import numpy as np

from ..errors import InputError
from ..recording import Recording
from ..simulation import prbs
from ..vehicle import AbstractVehicle
from .autopilot import Autopilot
from .closed_loop import fly
from .limits import FinLimits

DEPTH_STEP, DEPTH_EVERY = 20.0, 5.0
COURSE_RATE, COURSE_EVERY = np.radians(20.0), 1.5


def references(times: np.ndarray) -> dict[str, np.ndarray]:
    """The commands of scenario I at `times` (s), (samples,) each.

    Depth 20 m more, then 20 m less, every 5 s; course rate 20°/s to starboard, then to port, every 1.5 s; zero roll.
    """
    # rounding of the times must not put a change one sample late
    turn = lambda every: np.floor((times - times[0]) / every + 1e-9).astype(int) % 2
    return {
        "depth": DEPTH_STEP * (1 - turn(DEPTH_EVERY)),
        "course_rate": COURSE_RATE * (1 - 2 * turn(COURSE_EVERY)),
        "roll": np.zeros_like(times),
    }


def scenario_one(
    vehicle: AbstractVehicle,
    seconds: float = 60.0,
    dt: float = 0.25,
    *,
    seed: int,
    limits: FinLimits | None = None,
    noise: bool = True,
) -> tuple[Recording, dict[str, np.ndarray]]:
    """Scenario I, the sea trial of `vehicle`, for `seconds` by autopilots sampled every `dt` s; and its `references`.

    The autopilots follow as far as the fins' `limits` let them. They are shown the sensors' `noise`, drawn by `seed`.

    **Raises** `InputError` where `dt` does not divide 1.5 s and 5 s, and as `Autopilot.of` and `fly` do.
    """
    times = _times(seconds, dt, (DEPTH_EVERY, COURSE_EVERY))
    commands = references(times)
    autopilot = Autopilot.of(vehicle, limits)
    return fly(vehicle, autopilot, commands, times, seed=seed, noise=noise, name="scenario I"), commands


def scenario_two(
    vehicle: AbstractVehicle,
    seconds: float = 60.0,
    dt: float = 0.25,
    *,
    seed: int,
    limits: FinLimits | None = None,
    noise: bool = True,
    rudder: float = 0.25,
    elevator: float = 0.12,
    hold: float = 1.5,
) -> list[Recording]:
    """Scenario II: a horizontal run of `vehicle`, then a vertical one, for `seconds` each, sampled every `dt` s.

    In the first the elevators hold depth and roll and the rudder follows a pseudo-random binary sequence of amplitude
    `rudder` (rad), drawn anew every `hold` s; in the second all elevators follow one of amplitude `elevator` (rad) and
    the rudder stays at zero. The sensors' `noise` and the sequences come from `seed`. The fins follow within their
    `limits`.

    **Raises** `InputError` where `dt` does not divide `hold`, and as `Autopilot.of` and `fly` do: a hull that is
    unstable with its rudder or elevators free is lost.
    """
    times = _times(seconds, dt, (hold,))
    autopilot = Autopilot.of(vehicle, limits)
    if autopilot.course is None or autopilot.depth is None:
        raise InputError(vehicle.layout.name, "scenario II turns and dives", "free its yaw and its pitch")
    columns = dict(vehicle.layout.inputs)
    seeds = [int(word) for word in np.random.SeedSequence(seed).generate_state(4)]
    sequence = lambda amplitude, source: prbs(len(times), round(hold / dt), amplitude, source)
    turning = {columns["rudder"]: sequence(rudder, seeds[0])}
    diving = dict.fromkeys([columns[fin] for fin in autopilot.depth.fins], sequence(elevator, seeds[1]))
    diving[columns["rudder"]] = np.zeros(len(times))
    runs = (("scenario II, horizontal", turning, seeds[2]), ("scenario II, vertical", diving, seeds[3]))
    return [fly(vehicle, autopilot, {}, times, seed=s, noise=noise, given=g, name=name) for name, g, s in runs]


def _times(seconds: float, dt: float, intervals: tuple[float, ...]) -> np.ndarray:
    """Samples every `dt` s for `seconds`, on which all `intervals` (s) begin and end."""
    for interval in intervals:
        if not dt > 0.0 or abs(interval / dt - round(interval / dt)) > 1e-9 or round(interval / dt) == 0:
            raise InputError(f"dt = {dt:g} s", f"does not divide {interval:g} s", "take 0.25, 0.1 or 0.05 s")
    return dt * np.arange(round(seconds / dt) + 1)
