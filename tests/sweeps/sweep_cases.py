"""A sweep small enough for tests: an oscillator, two short recordings, six chunks."""

import functools
from pathlib import Path

import jax.numpy as jnp
import numpy as np
from rigs import driven, oscillator

from jaxsub.recording import save
from jaxsub.simulation import synthetic
from jaxsub.sweeps import Plan
from jaxsub.vehicle import write_vehicle

AWAY = {"D_x": 0.5, "K_x": 4.6, "B_x_drive": 2.3}
STARTS, WIDTH = 96, 16
EXACT = ("initial_guess", "estimate", "standard_error", "cost", "coordinates", "evaluations", "outcome")


@functools.cache
def vehicle():
    """The oscillator with coefficients up to a fifth off."""
    return oscillator().with_values({name: jnp.asarray(value) for name, value in AWAY.items()})


@functools.cache
def recordings(count=1, noise=True):
    """What the true oscillator recorded."""
    driving = [driven(oscillator(), 0.1 * np.arange(50), seed=i, amplitude=1.0) for i in range(count)]
    return synthetic(oscillator(), driving, seed=1, noise=noise)


def plan(**changes):
    """96 starts on one recording in six chunks."""
    base = {"vehicles": {"oscillator": vehicle()}, "recordings": {"run": recordings()}, "starts": STARTS, "spread": 0.8}
    return Plan(**(base | {"width": [WIDTH]} | changes))


def files(folder: Path) -> list[str]:
    """The arguments of `jaxsub sweep` for such a sweep, its files written to `folder`."""
    write_vehicle(vehicle(), folder / "vehicle.toml")
    save(recordings()[0], folder / "run.csv")
    return ["sweep", *(str(folder / name) for name in ("vehicle.toml", "run.csv")), "--out", str(folder / "out")]


def farthest(one, other):
    """The largest difference of two sweeps' answers, each relative to the largest of its kind."""
    size = lambda name: max(1.0, float(np.nanmax(np.abs(one[name].values))))
    for name in EXACT:
        np.testing.assert_array_equal(np.isnan(one[name].values), np.isnan(other[name].values))
    return max(float(np.nanmax(np.abs(one[name].values - other[name].values))) / size(name) for name in EXACT)


def tree(folder):
    """The files below `folder` and their contents."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
