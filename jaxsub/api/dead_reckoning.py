"""States along recordings with the vehicle's dynamics as motion model, and how they drift while a sensor is out."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, final

import numpy as np

from ..errors import InputError, require_known
from ..estimate import Outage, Track, kinematic_filter, model_filter, tracks_of
from ..recording import Recording, save
from ..recording.recording import Recordings
from ..vehicle import AbstractVehicle
from .recordings import checked
from .result import AbstractResult
from .states import innovation_table
from .table import Parts, Table

if TYPE_CHECKING:
    from ..report import Picture


class Drift(NamedTuple):
    """How far states at the end of an outage are from the smoothed ones of all measurements.

    **Fields**

    - `run`: its name. `outage`: which. `model`: `model`, `none` for kinematics alone, or `improved`.
    - `error`, `sigma`: by state, SI; `position` is the horizontal distance.
    """

    run: str
    outage: Outage
    model: str
    error: dict[str, float]
    sigma: dict[str, float]


def dead_reckon(
    vehicle: AbstractVehicle,
    recordings: Recordings,
    *,
    outages: Sequence[Outage] = (),
    improved: AbstractVehicle | None = None,
) -> "DeadReckoning":
    """The states of `vehicle` along `recordings`, its dynamics the motion model, filtered and smoothed.

    Coefficients are taken as known. A Gauss–Markov force in each equation, whose size and time constant make the runs
    most probable, is what the model does not know. In each of the `outages` the states are estimated without those
    channels: by the vehicle, by kinematics alone, and by the `improved` vehicle where there is one.

    **Raises** `InputError` for recordings that cannot be used, effects whose memory no filter holds, and outages of a
    channel that is not measured or in which no run has a sample.
    """
    runs = checked(vehicle, recordings).recordings
    for outage in outages:
        require_known("channel", outage.channels, vehicle.layout.channels, vehicle.layout.name)
        if not any(outage.covers(run).any() for run in runs):
            where = f"outage from {outage.begin:g} to {outage.end:g} s"
            raise InputError(where, "no run has a sample there", "give times of the recordings' clock")
    filters = {"model": model_filter(vehicle, runs)}
    if outages:
        filters["none"] = kinematic_filter(vehicle, runs)
    if outages and improved is not None:
        filters["improved"] = model_filter(improved, runs)
    tracks: dict[str, list[list[Track]]] = {}
    for name, filter in filters.items():
        tracks[name] = tracks_of(improved if improved and name == "improved" else vehicle, filter, runs, outages)
    reference = tracks["model"][0]
    drifts = [
        _drift(vehicle, run, outage, name, found[1 + i][r], reference[r])
        for i, outage in enumerate(outages)
        for r, run in enumerate(runs)
        for name, found in tracks.items()
        if outage.covers(run).any()
    ]
    return DeadReckoning(vehicle, tuple(runs), tuple(reference), tuple(drifts))


def _drift(
    vehicle: AbstractVehicle, run: Recording, outage: Outage, name: str, found: Track, reference: Track
) -> Drift:
    """At the last sample of an outage, on line: errors of the states that it hides or that integrate them."""
    at = int(np.flatnonzero(outage.covers(run))[-1])
    states = vehicle.layout.states
    difference = found.filtered[at] - reference.smoothed[at]
    turns = np.array([vehicle.layout.is_angle(state) for state in states])
    difference = np.where(turns, np.arctan2(np.sin(difference), np.cos(difference)), difference)
    error = dict(zip(states, map(float, difference), strict=True))
    sigma = dict(zip(states, map(float, found.filtered_std[at]), strict=True))
    if {"x", "y"} <= set(states) and vehicle.layout.kind == "submerged-body":
        error["position"] = float(np.hypot(error["x"], error["y"]))
        sigma["position"] = float(np.hypot(sigma["x"], sigma["y"]))
    return Drift(run.name, outage, name, error, sigma)


@final
@dataclasses.dataclass(frozen=True, repr=False, eq=False)
class DeadReckoning(AbstractResult):
    """Filtered and smoothed states along recordings, and drifts in outages.

    **Fields**

    - `vehicle`: the model. `recordings`: the runs as they were used. `tracks`: of each run. `drifts`: of each outage,
      run and model.
    """

    vehicle: AbstractVehicle
    recordings: tuple[Recording, ...]
    tracks: tuple[Track, ...]
    drifts: tuple[Drift, ...]

    def brief(self) -> Parts:
        """By run and state the standard deviations, and what drifts."""
        names = self.vehicle.layout.states
        rows = []
        for run, track in zip(self.recordings, self.tracks, strict=True):
            rows += [
                (run.name, name, f"{a:.3g}", f"{b:.3g}", self.vehicle.layout.unit(name))
                for name, a, b in zip(names, *_usual(track), strict=True)
            ]
        title = f"States of {self.vehicle.layout.name}"
        parts = [title, Table(("run", "state", "σ filtered, median", "σ smoothed", "unit"), rows)]
        return [*parts, self._drift_table()] if self.drifts else parts

    def parts(self) -> Parts:
        """The same, and by run and channel the rms of innovations in their standard deviations."""
        innovations = (track.innovations for track in self.tracks)
        return [*self.brief(), innovation_table(self.vehicle, self.recordings, innovations)]

    def _drift_table(self) -> Table:
        shown = lambda drift: ["position"] if "position" in drift.error else self._hidden(drift.outage)
        rows = [
            (d.run, ",".join(d.outage.channels), f"{d.outage.begin:g} to {d.outage.end:g}", state, d.model,
             f"{d.error[state]:.3g}", f"{d.sigma[state]:.3g}")
            for d in self.drifts for state in dict.fromkeys([*shown(d), *self._hidden(d.outage)])
        ]  # fmt: skip
        return Table(("run", "outage of", "s", "state", "motion model", "error at its end", "σ"), rows)

    def _hidden(self, outage: Outage) -> list[str]:
        """The states whose channels are out, or all where these are no states."""
        states = self.vehicle.layout.states
        return [name for name in outage.channels if name in states] or list(states)

    def to_json(self) -> dict[str, Any]:
        """What a program wants to know, with plain numbers."""
        names = self.vehicle.layout.states
        runs = [
            {
                "run": run.name,
                "samples": len(run.times),
                "sigma": {
                    name: {"filtered": float(a), "smoothed": float(b), "unit": self.vehicle.layout.unit(name)}
                    for name, a, b in zip(names, *_usual(track), strict=True)
                },
            }
            for run, track in zip(self.recordings, self.tracks, strict=True)
        ]
        outages = [
            {"run": d.run, "channels": list(d.outage.channels), "from": d.outage.begin, "to": d.outage.end,
             "motion_model": d.model, "error": d.error, "sigma": d.sigma}
            for d in self.drifts
        ]  # fmt: skip
        return {"schema": 1, "vehicle": self.vehicle.layout.name, "runs": runs, "outages": outages}

    def plot(self, run: int = 0) -> "Picture":
        """Measured outputs of a run and those one step ahead, with the innovations in their standard deviations."""
        from ..report import draw_run

        own, track, layout = self.recordings[run], self.tracks[run], self.vehicle.layout
        measured = np.stack([own.column(column) for column in layout.columns], axis=1)
        return draw_run(
            self.vehicle,
            own,
            measured - track.innovations * track.innovation_std,
            np.median(track.innovation_std, axis=0),
        )

    def recording(self, run: int, smoothed: bool = True) -> Recording:
        """The states of a run, `smoothed` or filtered, as a recording with inputs, and sigma in `sigma_NAME`."""
        own, track, layout = self.recordings[run], self.tracks[run], self.vehicle.layout
        values, std = (track.smoothed, track.smoothed_std) if smoothed else (track.filtered, track.filtered_std)
        table = dict(zip(layout.states, values.T, strict=True))
        table |= {f"sigma_{name}": one for name, one in zip(layout.states, std.T, strict=True)}
        table |= {name: own.column(name) for name in (*layout.held, *layout.interpolated) if name not in table}
        units = {name: layout.unit(name) for name in layout.states if layout.unit(name)}
        return Recording(own.name, own.times, table, own.source, units=units)

    def write(self, folder: Path) -> None:
        """Write the smoothed states of each run as `NAME.parquet`, and the filtered ones as `NAME_filtered.parquet`."""
        for index, run in enumerate(self.recordings):
            name = Path(run.name).stem
            save(self.recording(index), folder / f"{name}.parquet")
            save(self.recording(index, smoothed=False), folder / f"{name}_filtered.parquet")


def _usual(track: Track) -> tuple[np.ndarray, np.ndarray]:
    """(s,) medians of the states' standard deviations, filtered and smoothed."""
    return np.median(track.filtered_std, axis=0), np.median(track.smoothed_std, axis=0)
