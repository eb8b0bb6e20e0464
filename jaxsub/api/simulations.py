"""Simulations: a vehicle's answer to the inputs of recordings, and how far it is from what was measured."""

import dataclasses
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, final

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..effects import AbstractEffect
from ..errors import InputError
from ..estimate import Assessment, assess_residuals, batch, channel_rms
from ..findings import Finding
from ..likelihood import residual_outputs
from ..recording import Recording, save, to_pandas, to_xarray
from ..recording.recording import Recordings, listed
from ..recording.runs import Runs
from ..report.text import unit
from ..simulation import simulate as sampled
from ..vehicle import AbstractVehicle, read_vehicle, recorded_columns, write_vehicle
from .initial_states import Start, initial_state, with_every_channel
from .recordings import checked
from .result import AbstractResult
from .stored import findings_of, store, stored
from .table import Parts, Table

if TYPE_CHECKING:
    import pandas
    import xarray

    from ..report import Picture

VEHICLE = "vehicle.toml"
_SAID: dict[Start, str] = {
    "rest": "The model starts at rest",
    "recorded": "The model starts from the first samples, and at rest where nothing is measured",
    "estimated": "The model starts from the initial state estimated from the whole recording",
}


def simulate(vehicle: AbstractVehicle, recordings: Recordings, *, start: Start = "estimated") -> "Simulation":
    """The answer of `vehicle` to the inputs of `recordings`: what `jaxsub simulate` computes.

    `recordings` are one or several, checked as `js.check` does; they need input columns, and are compared with where
    they have outputs. The model starts at `rest`, from the `recorded` first samples, or from the initial state that
    the whole recording makes most probable, `estimated`.

    **Raises** `InputError` for recordings that cannot be used, where the model diverges, and for a recorded start of
    which a sensor's first sample is late.
    """
    runs = checked(vehicle, [with_every_channel(recording, vehicle) for recording in listed(recordings)])
    return Simulation(tuple(simulated(vehicle, recording, start) for recording in runs.recordings))


def simulated(vehicle: AbstractVehicle, recording: Recording, start: Start, file: str = "") -> "SimulatedRun":
    """The answer of `vehicle`, which may be from a `file`, to a checked recording.

    **Raises** `InputError` where the model diverges, and as `initial_state` does.
    """
    runs = batch(vehicle, [recording]).padded()
    began, state, findings = initial_state(vehicle, runs, recording, start)
    shown = sampled(vehicle, runs, state[None])
    if not np.all(np.isfinite(np.asarray(shown))):
        what = "the model diverges on these inputs"
        raise InputError(file or vehicle.layout.name, what, "check the coefficients' signs")
    outputs = np.asarray(shown)[0, : len(recording.times)]
    assessment, errors = channel_errors(vehicle, runs, shown)
    findings += unexplained(assessment, recording.source)
    return SimulatedRun(vehicle, recording, outputs, began, np.asarray(state), assessment, errors, tuple(findings))


@dataclasses.dataclass(frozen=True)
class ChannelError:
    """The simulation error of one measured channel.

    **Fields**

    - `samples`: how many were measured. `unit`: SI. `rms`: in that unit.
    - `sigma`: the vehicle file's noise; None where it states none. `rms_over_sigma`: where σ is stated.
    - `white_p_value`: of the test of whiteness; None where it does not apply.
    """

    samples: int
    unit: str
    rms: float
    sigma: float | None
    rms_over_sigma: float | None
    white_p_value: float | None


@final
@dataclasses.dataclass(frozen=True, repr=False, eq=False)
class SimulatedRun(AbstractResult):
    """A vehicle's answer to the inputs of one recording.

    **Fields**

    - `vehicle`, `recording`: what was simulated, along which run of K samples.
    - `outputs`: (K, c) the c outputs without noise, SI.
    - `start`: how the model starts. `initial_state`: (s,) in the order of `vehicle.layout.states`, SI.
    - `assessment`: tests of the simulation error. `errors`: by measured channel. `findings`: what is to be said.
    """

    vehicle: AbstractVehicle
    recording: Recording
    outputs: np.ndarray
    start: Start
    initial_state: np.ndarray
    assessment: Assessment
    errors: dict[str, ChannelError]
    findings: tuple[Finding, ...] = ()

    def answer(self, name: str = "", source: str = "simulation") -> Recording:
        """The recording's inputs with the model's outputs, named as the run or by `name`."""
        layout = self.vehicle.layout
        table = {column: self.recording.column(column) for column in (*layout.held, *layout.interpolated)}
        table |= recorded_columns(layout.outputs, self.outputs)
        return Recording(name or self.recording.name, self.recording.times, table, source)

    def brief(self) -> Parts:
        """How the model starts, and the errors."""
        states = zip(self.vehicle.layout.states, self.initial_state, strict=True)
        values = ", ".join(f"{name} {float(value):.4g}" for name, value in states)
        return [f"{_SAID[self.start]}: {values} (SI).", *([self.table()] if self.errors else [])]

    def parts(self) -> Parts:
        """The same with what is to be said of the run."""
        return [*self.brief(), *(finding.line() for finding in self.findings)]

    def table(self) -> Table:
        """The errors by channel."""
        rows = []
        for channel, one in self.errors.items():
            over = (
                ("not stated", "") if one.rms_over_sigma is None else (f"{one.sigma:.4g}", f"{one.rms_over_sigma:.2f}")
            )
            rows.append((channel, str(one.samples), f"{one.rms:.4g}", unit(one.unit), *over))
        return Table(("channel", "samples", "rms error", "unit", "σ", "rms/σ"), rows)

    def plot(self) -> "Picture":
        """Measured and simulated outputs with the residuals, for the channels that fit worst."""
        from ..report import draw_run

        layout = self.vehicle.layout
        sigma = [one.sigma or (self.errors[one.name].rms if one.name in self.errors else 1.0) for one in layout.outputs]
        return draw_run(self.vehicle, self.recording, self.outputs, np.array(sigma))

    def to_dataframe(self) -> "pandas.DataFrame":
        """Times, inputs and simulated outputs, as `js.from_pandas` reads them."""
        return to_pandas(self.answer())

    def to_xarray(self) -> "xarray.Dataset":
        """The same along `t`, as `js.from_xarray` reads it."""
        return to_xarray(self.answer())

    def to_json(self) -> dict[str, Any]:
        """What the command prints with `--json`, but for where it was written and what checks found."""
        layout = self.vehicle.layout
        return {
            "schema": 1,
            "vehicle": layout.name,
            "run": self.recording.source,
            "start": self.start,
            "initial_state": dict(zip(layout.states, self.initial_state, strict=True)),
            "fit": {channel: dataclasses.asdict(one) for channel, one in self.errors.items()},
            "explains": self.assessment.explains if self.errors else None,
        }

    def write(self, folder: Path) -> None:
        """Write the answer as a recording, named as its run, into `folder`."""
        save(self.answer(), folder / f"{Path(self.recording.name).stem}.csv")


@final
@dataclasses.dataclass(frozen=True, repr=False, eq=False)
class Simulation(AbstractResult):
    """A vehicle's answer to the inputs of recordings; as a sequence it is its runs.

    **Fields**

    - `runs`: one for each recording, or for each piece where time has a hole.
    """

    runs: tuple[SimulatedRun, ...]

    @classmethod
    def load(cls, folder: str | Path, effects: Sequence[type[AbstractEffect]] = ()) -> "Simulation":
        """The simulation that `save` wrote to `folder`; `effects` are a user's own that the vehicle has.

        **Raises** `InputError` where there is none.
        """
        kept, vehicle = stored(Path(folder), cls.__name__), read_vehicle(Path(folder) / VEHICLE, effects)
        runs = []
        for index, (recording, own) in enumerate(zip(kept.recordings, kept.text["simulated"], strict=True)):
            outputs, stacked = kept.arrays[f"outputs/{index}"], batch(vehicle, [recording]).padded()
            more = stacked.times.shape[1] - len(outputs)
            tests = channel_errors(vehicle, stacked, jnp.pad(jnp.asarray(outputs), ((0, more), (0, 0)))[None])
            state, findings = kept.arrays[f"state/{index}"], findings_of(own["findings"])
            runs.append(SimulatedRun(vehicle, recording, outputs, own["start"], state, *tests, findings))
        return cls(tuple(runs))

    def __len__(self) -> int:
        return len(self.runs)

    def __getitem__(self, index: int) -> SimulatedRun:
        return self.runs[index]

    @property
    def recordings(self) -> list[Recording]:
        """The answers as recordings: inputs as recorded, outputs as simulated."""
        return [run.answer() for run in self.runs]

    def brief(self) -> Parts:
        """The errors of every run."""
        heads = ("run", "channel", "samples", "rms error", "unit", "σ", "rms/σ")
        rows = [(run.recording.name, *row) for run in self.runs for row in run.table().rows]
        title = f"{self.runs[0].vehicle.layout.name} along {len(self.runs)} run{'s' * (len(self.runs) != 1)}"
        return [f"Simulation of {title}.", *([Table(heads, rows)] if rows else [])]

    def parts(self) -> Parts:
        """All that is to be said of each run."""
        return [part for run in self.runs for part in (f"{run.recording.name}:", *run.parts())]

    def plot(self, run: int = 0) -> "Picture":
        """The run numbered `run` as `SimulatedRun.plot` draws it."""
        return self.runs[run].plot()

    def to_dataframe(self) -> "pandas.DataFrame":
        """The answers of all runs below each other, the run's name as the outer index."""
        import pandas

        return pandas.concat({run.recording.name: run.to_dataframe() for run in self.runs}, names=["run"])

    def to_xarray(self) -> "xarray.DataTree":
        """The answers as a tree with a dataset for each run."""
        import xarray

        return xarray.DataTree.from_dict({run.recording.name: run.to_xarray() for run in self.runs})

    def write(self, folder: Path) -> None:
        """Write a recording for each run, `vehicle.toml` and, from which `load` makes it again, `result.npz`."""
        written = Counter[str]()
        for run in self.runs:
            stem = Path(run.recording.name).stem
            written[stem] += 1
            # pieces of one run have its name
            save(run.answer(), folder / f"{stem}{f'-{written[stem]}' if written[stem] > 1 else ''}.csv")
        write_vehicle(self.runs[0].vehicle, folder / VEHICLE)
        arrays = {f"outputs/{index}": run.outputs for index, run in enumerate(self.runs)}
        arrays |= {f"state/{index}": run.initial_state for index, run in enumerate(self.runs)}
        own = [{"start": run.start, "findings": run.findings} for run in self.runs]
        store(folder, type(self).__name__, {"simulated": own}, arrays, [run.recording for run in self.runs])


def channel_errors(
    vehicle: AbstractVehicle, runs: Runs, shown: Float[Array, "1 k c"]
) -> tuple[Assessment, dict[str, ChannelError]]:
    """The tests of the simulation error of outputs `shown`, SI, and its size by measured channel."""
    layout = vehicle.layout
    error = residual_outputs(vehicle, runs, shown)
    rms = channel_rms(error, runs, layout.channels)
    stated = {one.name: one.sigma for one in layout.outputs}
    sigma = np.array([rms[name] or 1.0 if size is None else size for name, size in stated.items()])
    known = [size is not None for size in stated.values()]
    assessment = assess_residuals(layout.channels, np.asarray(error) / sigma, np.asarray(runs.mask), known=known)
    errors = {
        one.channel: ChannelError(
            one.samples,
            layout.unit(one.channel),
            rms[one.channel],
            stated[one.channel],
            one.rms if one.known else None,
            one.white,
        )
        for one in assessment.channels
    }
    return assessment, errors


def unexplained(assessment: Assessment, where: str) -> list[Finding]:
    """A warning, unless the model explains the run or nothing of it was measured."""
    if not assessment.channels or assessment.explains:
        return []
    what = f"the model does not explain this run: {assessment.reason()}"
    return [
        Finding("unexplained-runs", "warning", where, what, "fit it by `jaxsub identify`, or try `jaxsub diagnose`")
    ]
