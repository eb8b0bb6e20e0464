"""Files that conceal a case's physics, and, apart from them, what is true."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import jax.numpy as jnp
import numpy as np

from jaxsub.recording import Recording, save
from jaxsub.vehicle import AbstractVehicle, write_vehicle

from .bodies import INTERVAL, NO_VELOCITY, body, commands, start_state
from .hydrostatics import temperature
from .logs import LOGGED, white
from .plan import Case
from .simulate import Drive, outputs
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
    rng = np.random.default_rng([case.seed, 7])
    vehicle = body(case.body, () if case.velocity else NO_VELOCITY)
    layout = vehicle.layout
    samples = round(case.seconds / INTERVAL)
    starts = np.stack([start_state(case.body, vehicle, rng) for _ in range(RUNS)])
    held = np.stack([commands(case.body, run, samples, rng) for run in range(RUNS)])
    calm = np.zeros((RUNS, samples, len(layout.equations)))
    drive = Drive(*(jnp.asarray(a) for a in (starts, held[:, :-1], calm)))
    sigma = np.array([output.sigma for output in layout.outputs])
    truths = tuple(TRUTHS[key] for key in case.concealed)
    train = Drive(*(a[:-1] for a in drive))
    amplitudes, reached = _sized(case, truths, Unabsorbed(vehicle, train, sigma)) if truths else ([], [])
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
    sizes = jnp.asarray(amplitudes) if amplitudes else jnp.zeros(0)
    ideal, states = (np.asarray(a) for a in outputs(vehicle, truths, sizes, drive))
    shown = ideal
    if case.noise == "coloured":
        pushed = drive._replace(push=jnp.asarray(_disturbance(vehicle, drive, sigma, rng)))
        shown, states = (np.asarray(a) for a in outputs(vehicle, truths, sizes, pushed))
    if not np.all(np.isfinite(shown)):
        return truth | {"reached": [0.0] * len(reached)}
    measured = LOGGED.get(case.condition, white)(shown, sigma, rng)
    stated = sigma * STATED.get(case.noise, 1.0)
    errors = np.sqrt(np.nanmean(((measured - ideal)[-1] / stated) ** 2, axis=0))
    truth["floor"] = dict(zip(layout.channels, errors.tolist(), strict=True))
    sigmas = [None] * len(sigma) if case.condition == "estimated" else stated.tolist()
    write(folder, nearly(vehicle, sigmas, rng), measured, held, states)
    return truth


def _sized(case: Case, truths: Sequence[Truth], seen: Unabsorbed) -> tuple[list[float], list[float]]:
    """The size `a` of each effect on its own, and the sigmas that it leaves."""
    found = [seen.largest(truth, case.sizes) for truth in truths]
    return [a for a, _ in found], [size for _, size in found]


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


def write(folder: Path, file: AbstractVehicle, measured: np.ndarray, held: np.ndarray, states: np.ndarray) -> None:
    """Write the vehicle `file` and a file a run: measured channels (R, K, c), commands (R, K, m), true states."""
    layout = file.layout
    folder.mkdir(parents=True, exist_ok=True)
    write_vehicle(file, folder / "vehicle.toml")
    t = INTERVAL * np.arange(measured.shape[1])
    for run in range(len(measured)):
        columns = dict(zip(layout.channels, measured[run].T, strict=True))
        columns |= dict(zip(layout.held, held[run].T, strict=True))
        columns |= {column: _surroundings(name, layout, states[run]) for name, column in layout.environment}
        save(Recording(f"run{run + 1}", t, columns, "experiment"), folder / f"run{run + 1}.csv")


def _surroundings(name: str, layout, states: np.ndarray) -> np.ndarray:
    """What an instrument would record of the water along the path."""
    z = states[:, len(layout.equations) + layout.positions.index("z")]
    return np.asarray({"temperature": temperature(z), "altitude": BOTTOM - z}[name])
