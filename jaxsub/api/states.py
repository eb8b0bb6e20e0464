"""States of a vehicle along recordings, by an extended Kalman filter of its model."""

import dataclasses
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ..estimate import batch, channel_noise, initial_guess
from ..filter import AbstractFilter, Estimate, ExtendedKalmanFilter, VehicleProcess, over_runs, samples, vehicle_filter
from ..programs import compiled
from ..recording import Recording, save, to_pandas, to_xarray
from ..recording.recording import Recordings
from ..recording.runs import Runs
from ..vehicle import AbstractVehicle
from .recordings import checked
from .result import AbstractResult
from .table import Parts, Table

if TYPE_CHECKING:
    import pandas
    import xarray

    from ..report import Picture


def estimate_states(
    vehicle: AbstractVehicle,
    recordings: Recordings,
    *,
    kind: type[AbstractFilter] = ExtendedKalmanFilter,
) -> "States":
    """The states of `vehicle` along `recordings`, filtered sample after sample, its coefficients taken as known.

    `recordings` are one or several, checked as `js.check` does. The filter is of that `kind`, with the process noise of
    `filter.vehicle_filter`. Noise of outputs is the vehicle file's; where that leaves it open, as found by a fit of the
    initial states alone.

    **Raises** `InputError` for recordings that cannot be used, and for effects whose memory no filter holds.
    """
    runs = checked(vehicle, recordings).recordings
    known = vehicle.holding(vehicle.values())
    stacked = batch(known, runs).padded()
    sigma = channel_noise(known, stacked)
    process = VehicleProcess.of(known, stacked.substeps)
    starts = jnp.asarray(initial_guess(known, stacked)[0])
    found = jax.tree.map(np.asarray, _filtered(vehicle_filter(process, sigma, kind), stacked, starts))
    cut = lambda index, run: jax.tree.map(lambda leaf: leaf[index, : len(run.times)], found)
    return States(vehicle, tuple(runs), tuple(cut(index, run) for index, run in enumerate(runs)))


def innovation_table(
    vehicle: AbstractVehicle, recordings: Iterable[Recording], whitened: Iterable[np.ndarray]
) -> Table:
    """By run and channel the rms of innovations, `whitened` (K, c) of each run in their standard deviations."""
    rows = []
    for run, own in zip(recordings, whitened, strict=True):
        for channel, values in zip(vehicle.layout.channels, own.T, strict=True):
            seen = values[np.isfinite(values)]
            rms = f"{np.sqrt(np.mean(seen**2)):.3g}" if seen.size else "none"
            rows.append((run.name, channel, str(seen.size), rms))
    return Table(("run", "channel", "samples", "rms innovation/its σ"), rows)


@compiled
def _filtered(filter: AbstractFilter, runs: Runs, starts: Array) -> Estimate:
    begun = filter.start(starts[0], jnp.zeros(0, starts.dtype), jnp.zeros((0, 0), starts.dtype))
    return over_runs(filter, begun, samples(runs), starts)[1]


@final
@dataclasses.dataclass(frozen=True, repr=False, eq=False)
class States(AbstractResult):
    """Filtered states along recordings.

    **Fields**

    - `vehicle`: the model. `recordings`: the runs as they were used.
    - `estimates`: of each run, by sample: states, standard deviations and innovations.
    """

    vehicle: AbstractVehicle
    recordings: tuple[Recording, ...]
    estimates: tuple[Estimate, ...]

    def whitened(self, run: int) -> np.ndarray:
        """(K, c) innovations of a run in the filter's standard deviations, NaN where missing or outside the gate."""
        found = self.estimates[run]
        return np.where(found.used, found.innovation / np.asarray(found.innovation_std), np.nan)

    def brief(self) -> Parts:
        """rms of the innovations in their standard deviations, by run and channel: 1 for a consistent filter."""
        diverged = [run.name for run, e in zip(self.recordings, self.estimates, strict=True) if np.any(e.diverged)]
        title = f"States of {self.vehicle.layout.name}: {', '.join(self.vehicle.layout.states)}."
        warning = [f"The filter diverged in {', '.join(diverged)}."] if diverged else []
        return [
            title,
            *warning,
            innovation_table(self.vehicle, self.recordings, map(self.whitened, range(len(self.recordings)))),
        ]

    def parts(self) -> Parts:
        """The same."""
        return self.brief()

    def plot(self, run: int = 0) -> "Picture":
        """Measured outputs of a run and those one step ahead, with the innovations in their standard deviations."""
        from ..report import draw_run

        recording, found, layout = self.recordings[run], self.estimates[run], self.vehicle.layout
        measured = np.stack([recording.column(column) for column in layout.columns], axis=1)
        size = np.median(np.asarray(found.innovation_std), axis=0)
        return draw_run(self.vehicle, recording, measured - np.asarray(found.innovation), size)

    def recording(self, run: int) -> Recording:
        """The states of a run as a recording, each with its standard deviation in the column `NAME_std`."""
        own, found = self.recordings[run], self.estimates[run]
        names = self.vehicle.layout.states
        table = {name: np.asarray(found.x)[:, i] for i, name in enumerate(names)}
        table |= {f"{name}_std": np.asarray(found.x_std)[:, i] for i, name in enumerate(names)}
        return Recording(own.name, own.times, table, f"{own.source} (filtered)")

    def to_dataframe(self) -> "pandas.DataFrame":
        """Times, states and standard deviations, the run's name as the outer index."""
        import pandas

        runs = range(len(self.recordings))
        return pandas.concat({self.recordings[i].name: to_pandas(self.recording(i)) for i in runs}, names=["run"])

    def to_xarray(self) -> "xarray.DataTree":
        """States and standard deviations as a tree with a dataset for each run."""
        import xarray

        runs = range(len(self.recordings))
        return xarray.DataTree.from_dict({self.recordings[i].name: to_xarray(self.recording(i)) for i in runs})

    def write(self, folder: Path) -> None:
        """Write the states of each run as a recording into `folder`."""
        for index, run in enumerate(self.recordings):
            save(self.recording(index), folder / f"{Path(run.name).stem}.csv")
