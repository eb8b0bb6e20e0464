"""Files that conceal a case's physics, and, apart from them, what is true."""

import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path

import jax.numpy as jnp
import numpy as np

from jaxsub.recording import Recording, save
from jaxsub.vehicle import AbstractVehicle, write_vehicle

from .autopilot import references
from .bodies import DIVE, INTERVAL, NO_VELOCITY, body, commands, start_state
from .hydrostatics import temperature
from .logs import LOGGED, white
from .plan import Case
from .simulate import Drive, outputs, steered
from .sizing import Unabsorbed
from .surroundings import BOTTOM
from .truth import Truth
from .truths import TRUTHS

RUNS = 4
COLOURED_SIGMAS, COLOURED_SECONDS = 3.0, 3.0
STATED = {"half": 0.5, "double": 2.0}


def generate(case: Case, folder: Path) -> dict:
    """Write `vehicle.toml` and `run1.csv` … of `case`; returns the truth, which no file holds.

    The last run is the one to hold out. Where an effect cannot be of any size in its row, `reached` is 0 and nothing is
    written.
    """
    way, rng = case.way, np.random.default_rng([case.seed, 7])
    vehicle = body(case.body, () if way.velocity else NO_VELOCITY, way.nonlinear)
    layout = vehicle.layout
    sigma = np.array([output.sigma for output in layout.outputs])
    truths = tuple(TRUTHS[key] for key in case.concealed)
    held, drive, amplitudes, reached = _driven(case, vehicle, truths, sigma, rng)
    truth = {
        "names": [t.name for t in truths],
        "where": [list(t.where) for t in truths],
        "lenient": [[*t.where, *t.lenient] for t in truths],
        "amplitudes": amplitudes,
        "numbers": [t.numbers(a) for t, a in zip(truths, amplitudes, strict=True)],
        "reached": reached,
        "floor": {},
    }
    if not all(reached):
        return truth
    ideal, states = (np.asarray(a) for a in outputs(vehicle, truths, jnp.asarray(amplitudes), drive))
    shown = ideal
    if way.noise == "coloured":
        pushed = drive._replace(push=jnp.asarray(_disturbance(vehicle, drive, sigma, rng)))
        shown, states = (np.asarray(a) for a in outputs(vehicle, truths, jnp.asarray(amplitudes), pushed))
    if not np.all(np.isfinite(shown)):
        return truth | {"reached": [0.0] * len(reached)}
    measured = LOGGED.get(way.logs, white)(shown, sigma, _noise(case) if way.autopilot else rng)
    errors = np.sqrt(np.nanmean((measured - ideal)[-1] ** 2, axis=0))
    truth["floor"] = dict(zip(layout.channels, errors.tolist(), strict=True))
    stated = sigma * STATED.get(way.noise, 1.0)
    sigmas = [None] * len(sigma) if way.noise == "estimated" else stated.tolist()
    write(folder, nearly(vehicle, sigmas, rng), measured, held, states)
    return truth


def _driven(
    case: Case, vehicle: AbstractVehicle, truths: tuple[Truth, ...], sigma: np.ndarray, rng: np.random.Generator
) -> tuple[np.ndarray, Drive, list[float], list[float]]:
    """Commands (R, K, m), what acts on the runs, the size `a` of each effect on its own, and the sigmas that it leaves.

    An autopilot's commands follow from the effects too, whose sizes are found anew under these.
    """
    samples = round(case.way.seconds / INTERVAL)
    starts = np.stack([start_state(case.body, vehicle, rng) for _ in range(RUNS)])
    if case.way.autopilot:
        steer = _autopilot(case, vehicle, starts, sigma, rng)
    else:
        fixed = np.stack([commands(case.body, run, samples, rng) for run in range(RUNS)])
        steer = lambda truths, sizes: fixed
    calm = np.zeros((RUNS, samples, len(vehicle.layout.equations)))
    drive = lambda held: Drive(jnp.asarray(starts), jnp.asarray(held[:, :-1]), jnp.asarray(calm))
    held, found = steer((), []), []
    for _ in range(1 + case.way.autopilot if truths else 0):
        seen = Unabsorbed(vehicle, drive(held).of(slice(-1)), sigma)
        found = [seen.largest(truth, case.sizes) for truth in truths]
        held = steer(truths, [a for a, _ in found])
    return held, drive(held), [a for a, _ in found], [size for _, size in found]


def _autopilot(
    case: Case, vehicle: AbstractVehicle, starts: np.ndarray, sigma: np.ndarray, rng: np.random.Generator
) -> Callable[[tuple[Truth, ...], list[float]], np.ndarray]:
    """The commands of an autopilot that sees the measurements with their noise, by what is concealed and its sizes."""
    samples = round(case.way.seconds / INTERVAL)
    named = [dict(zip(vehicle.layout.states, start, strict=True)) for start in starts]
    wanted = np.stack([references(start, DIVE.get(case.body, 1.0), samples, rng) for start in named])
    errors = white(np.zeros((RUNS, samples, len(sigma))), sigma, _noise(case))
    return lambda truths, sizes: np.asarray(
        steered(vehicle, truths, jnp.asarray(sizes), *map(jnp.asarray, (starts, wanted, errors)))
    )


def _noise(case: Case) -> np.random.Generator:
    """That of the sensors that an autopilot sees, and a recording holds."""
    return np.random.default_rng([case.seed, 8])


def _disturbance(vehicle: AbstractVehicle, drive: Drive, sigma: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A first-order Gauss-Markov force in every equation, (R, K, n), in proportion to the forces of the manoeuvres,
    scaled so that its response is of `COLOURED_SIGMAS` rms on the most affected channel of the training runs."""
    clean, states = (np.asarray(a) for a in outputs(vehicle, (), jnp.zeros(0), drive))
    n = len(vehicle.layout.equations)
    inertial = np.gradient(states[..., :n], INTERVAL, axis=1) @ np.asarray(vehicle.mass_matrix()).T
    scale = np.sqrt(np.mean(inertial**2, axis=(0, 1)))
    fade = np.exp(-INTERVAL / COLOURED_SECONDS)
    force = rng.standard_normal(drive.push.shape)
    for k in range(1, force.shape[1]):
        force[:, k] = fade * force[:, k - 1] + np.sqrt(1.0 - fade**2) * force[:, k]
    small = 1e-3 * scale * force
    moved = np.asarray(outputs(vehicle, (), jnp.zeros(0), drive._replace(push=jnp.asarray(small)))[0])
    response = np.sqrt(np.mean(((moved - clean)[:-1] / sigma) ** 2, axis=(0, 1))).max()
    return small * COLOURED_SIGMAS / response


def nearly(vehicle: AbstractVehicle, sigmas: Sequence[float | None], rng: np.random.Generator) -> AbstractVehicle:
    """The vehicle as its owner knows it: every free number off by 10 to 20 %, and these `sigmas` of its channels."""
    layout, values = vehicle.layout, vehicle.values()
    off = {p.name: rng.choice([-1.0, 1.0]) * rng.uniform(0.1, 0.2) for p in layout.free}
    guess = vehicle.with_values({name: values[name] * (1.0 + share) for name, share in off.items()})
    outs = tuple(dataclasses.replace(o, sigma=s) for o, s in zip(layout.outputs, sigmas, strict=True))
    return dataclasses.replace(guess, layout=dataclasses.replace(layout, outputs=outs))


def write(
    folder: Path,
    file: AbstractVehicle,
    measured: np.ndarray,
    held: np.ndarray,
    states: np.ndarray,
    prescribed: np.ndarray | None = None,
    interval: float = INTERVAL,
) -> None:
    """Write the vehicle `file` and a file a run, with a sample each `interval` s.

    Of measured channels (R, K, c), commands (R, K, m), true states, and motions that the file prescribes, (R, K, p).
    """
    layout = file.layout
    folder.mkdir(parents=True, exist_ok=True)
    write_vehicle(file, folder / "vehicle.toml")
    t = interval * np.arange(measured.shape[1])
    for run in range(len(measured)):
        columns = dict(zip(layout.channels, measured[run].T, strict=True))
        columns |= dict(zip(layout.held, held[run].T, strict=True))
        if prescribed is not None:
            columns |= {column: prescribed[run, :, i] for i, (_, column) in enumerate(layout.prescribed)}
        columns |= {column: _surroundings(name, layout, states[run]) for name, column in layout.environment}
        save(Recording(f"run{run + 1}", t, columns, "experiment"), folder / f"run{run + 1}.csv")


def _surroundings(name: str, layout, states: np.ndarray) -> np.ndarray:
    """What an instrument would record of the water along the path."""
    z = states[:, len(layout.equations) + layout.positions.index("z")]
    return np.asarray({"temperature": temperature(z), "altitude": BOTTOM - z}[name])
