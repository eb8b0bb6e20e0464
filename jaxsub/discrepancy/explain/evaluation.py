"""Models simulated along the test runs, once, after the last decision."""

import dataclasses
import math
from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Array, Float

from ...estimate import channel_rms, initial_guess, search, side_by_side
from ...likelihood import filter_runs, residual_outputs
from ...recording import Recording
from ...recording.runs import Runs
from ...simulation import simulate
from ...vehicle import AbstractVehicle
from .. import settings
from ..accept.acceptance import Model
from ..accept.cross_validation import gain
from ..accept.restarts import restarted
from ..records.diagnosis import Gain, Overlay


@dataclasses.dataclass(frozen=True)
class Evaluation:
    """A model's simulation of the test runs, of which only the initial states were estimated.

    **Fields**

    - `predicted`, `error`: lists of (K, c) arrays in SI, a run each. `rms`: rms(error)/σ by channel.
    - `squares`: (K,) the squared errors/σ of each sample, a run each; infinite where the model diverges.
    """

    predicted: list[np.ndarray]
    error: list[np.ndarray]
    rms: dict[str, float]
    squares: list[np.ndarray]


def evaluated(
    vehicle: AbstractVehicle,
    train: Sequence[Recording],
    test: Sequence[Recording],
    models: Sequence[Model],
    pieces: int,
) -> list[Evaluation]:
    """Each of `models` simulated along the runs `test`, in several `pieces` from a filter's state at each of them.

    The batches are as large and as long as that of the runs `train`, so that no other programs are needed.
    """
    runs, size = side_by_side(vehicle, [*train, *test]).padded(), len(train)
    found = []
    for model in models:
        # as short steps as the model was fitted with, also where the test runs are sampled more coarsely
        fitted, longest = model.view.runs, lambda batch: float(np.max(np.asarray(batch.steps)))
        steps = math.ceil(fitted.substeps * longest(runs) / longest(fitted) - 1e-9)
        finer = dataclasses.replace(runs, substeps=max(runs.substeps, steps))
        predicted, errors = [], []
        for first in range(size, size + len(test), size):
            chosen = range(first, min(first + size, size + len(test)))
            taken = finer.take(chosen, size)
            shown = _simulated(model, taken, pieces)
            predicted += list(np.asarray(shown)[: len(chosen)])
            errors += list(np.asarray(residual_outputs(model.fit.vehicle, taken, shown))[: len(chosen)])
        whole = finer.take(range(size, size + len(test)), len(test))
        white = np.stack(errors) / np.asarray(model.fit.sigma)
        rms = channel_rms(white, whole, vehicle.layout.channels)
        squares = np.sum(white**2, axis=-1)
        squares = np.where(np.isnan(squares), np.inf, squares)
        each = [run[: len(recording.times)] for run, recording in zip(squares, test, strict=True)]
        found.append(Evaluation(predicted, errors, rms, each))
    return found


def _simulated(model: Model, runs: Runs, pieces: int) -> Float[Array, "r k c"]:
    """What a model shows along `runs`, from initial states that are fitted, or in pieces from filtered states."""
    vehicle, sigma = model.fit.vehicle, model.fit.sigma
    if pieces == 1:
        return simulate(vehicle, runs, search(vehicle, runs, sigma=sigma, moving=False).start)
    followed = filter_runs(vehicle, runs, sigma, model.view.disturbance, *initial_guess(vehicle, runs))
    return restarted(vehicle, followed, runs, pieces)


def test_gain(before: Evaluation, after: Evaluation, pieces: int) -> Gain:
    """The ratio of squared simulation errors on the test runs, and how probable so large a fall is by chance.

    By Student's t over blocks of every run, no shorter than the pieces of a simulation.
    """
    blocks = lambda one: np.concatenate([_sums(run, max(settings.BLOCKS, pieces)) for run in one.squares])
    total = lambda one: float(sum(run.sum() for run in one.squares))
    return Gain(total(after) / max(total(before), 1e-300), gain(-blocks(before), -blocks(after)).better)


def _sums(samples: Float[np.ndarray, " k"], blocks: int) -> Float[np.ndarray, " b"]:
    return np.array([part.sum() for part in np.array_split(samples, blocks)])


def overlays(
    recordings: Sequence[Recording], columns: Mapping[str, str], baseline: Evaluation, improved: Evaluation
) -> list[Overlay]:
    """Measured and simulated outputs of the test runs; `columns` has the measured column of each output."""
    drawn = []
    for recording, before, after in zip(recordings, baseline.predicted, improved.predicted, strict=True):
        k = len(recording.times)
        named = lambda table, k=k: {c: table[:k, i] for i, c in enumerate(columns)}
        measured = {c: recording.column(column) for c, column in columns.items()}
        drawn.append(Overlay(recording.name, recording.times, measured, named(before), named(after)))
    return drawn
