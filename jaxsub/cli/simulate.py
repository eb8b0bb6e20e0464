"""`jaxsub simulate`: the model's answer to a recording's inputs, and how far it is from what was measured."""

import dataclasses
from pathlib import Path
from typing import Any, Literal

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..errors import InputError
from ..estimate import Assessment, assess_residuals, batch, channel_rms, initial_guess, rest, search, state_channels
from ..findings import Finding
from ..likelihood import residual_outputs
from ..recording import Recording, save
from ..recording.runs import Runs
from ..report.text import unit
from ..results import RESULTS
from ..simulation import simulate
from ..vehicle import AbstractVehicle, read_vehicle, recorded_columns, vehicle_findings
from . import session, terminal
from .output import fresh_file, paths_of
from .runs import checked_run, load_run

Start = Literal["rest", "recorded", "estimated"]


def run(
    vehicle_path: Path,
    run_path: Path,
    out: Path,
    overwrite: bool,
    columns: Path | None = None,
    start: Start = "estimated",
) -> None:
    """Write the recording's inputs and the model's outputs to `out`, and show their errors where they were measured.

    The model starts at rest, from the recorded first samples, or from the initial state that the whole recording makes
    most probable, as `diagnose` and `identify` estimate it. Of a log, the file at `columns` says what to take.
    """
    session.start(recordings=[run_path])
    with fresh_file(out, overwrite, paths_of(vehicle_path, run_path, columns)) as path:
        vehicle = read_vehicle(vehicle_path)
        recording = checked_run(with_every_channel(load_run(run_path, vehicle, columns), vehicle), vehicle)
        shown = simulated(vehicle, recording, start, str(vehicle_path), out)
        save(answer(vehicle, recording, shown, out), path)


def simulated(
    vehicle: AbstractVehicle, recording: Recording, start: Start, where: str, out: Path
) -> Float[np.ndarray, "k c"]:
    """The outputs of the vehicle read from `where`, in SI units; shows their errors and what is to be said of them.

    **Raises** `InputError` where the model diverges, and as `initial_state` does.
    """
    with terminal.progress(f"simulating {vehicle.layout.name}"):
        runs = batch(vehicle, [recording]).padded()
        began, state, findings = initial_state(vehicle, runs, recording, start)
        shown = simulate(vehicle, runs, state[None])
    if not np.all(np.isfinite(np.asarray(shown))):
        raise InputError(where, "the model diverges on these inputs", "check the coefficients' signs")
    known = vehicle_findings(vehicle, vehicle.layout.name)
    fit, assessment = errors(vehicle, runs, shown)
    findings += unexplained(assessment, recording.source)
    terminal.warn(findings)
    content = {
        "schema": 1,
        "vehicle": vehicle.layout.name,
        "run": recording.source,
        "out": out,
        "start": began,
        "initial_state": dict(zip(vehicle.layout.states, state, strict=True)),
        "fit": fit,
        "explains": assessment.explains if fit else None,
        "warnings": [finding.to_json() for finding in (*known, *recording.findings, *findings)],
    }
    terminal.emit(content, lambda: show(began, content["initial_state"], fit))
    return np.asarray(shown)[0, : len(recording.times)]


def with_every_channel(recording: Recording, vehicle: AbstractVehicle) -> Recording:
    """The recording with the columns of the vehicle's outputs that it lacks as columns of missing samples.

    **Raises** `InputError` for a channel that it has and that cannot be used.
    """
    measured = vehicle.layout.columns
    absent = [c for c in measured if c not in recording.columns and c not in recording.unusable]
    table = {c: recording.column(c) for c in measured if c not in absent}
    nothing = np.full(len(recording.times), np.nan)
    columns = recording.columns | table | dict.fromkeys(absent, nothing)
    return dataclasses.replace(recording, columns=columns)


def initial_state(
    vehicle: AbstractVehicle, runs: Runs, recording: Recording, start: Start
) -> tuple[Start, Float[Array, " s"], list[Finding]]:
    """How the one run starts, its initial state in SI units, and what is to be said of it.

    Where nothing is measured the model starts at rest. **Raises** `InputError` for a recorded start of which a sensor's
    first sample is later than the longest interval between its samples, or an estimated one with which it diverges.
    """
    where = recording.source
    if start != "rest" and not np.any(np.asarray(runs.mask)):
        what = f"has no sample of {', '.join(vehicle.layout.channels)}; the model starts at rest"
        return "rest", rest(vehicle, 1)[0], [Finding("initial-state", "note", where, what)]
    if start == "rest":
        return start, rest(vehicle, 1)[0], []
    if start == "recorded":
        _require_prompt(vehicle, runs, where)
        return start, initial_guess(vehicle, runs)[0][0], []
    found = search(vehicle, runs, moving=False)
    if not bool(jnp.isfinite(found.cost)):
        raise InputError(where, "the model diverges from every initial state tried", "check the coefficients' signs")
    if found.converged:
        return start, found.start[0], []
    what = f"the search for the initial state did not converge: {RESULTS[found.result]}"
    return start, found.start[0], [Finding("initial-state", "warning", where, what, "try --start recorded")]


def _require_prompt(vehicle: AbstractVehicle, runs: Runs, where: str) -> None:
    for channel in state_channels(vehicle.layout).values():
        times = np.asarray(runs.times)[0, np.asarray(runs.mask)[0, :, vehicle.layout.channels.index(channel)]]
        longest = np.max(np.diff(times), initial=0.0)
        if len(times) and times[0] > longest:
            what = f"{channel} has its first sample at {times[0]:.4g} s, later than its longest gap, {longest:.4g} s"
            raise InputError(where, what, "give --start estimated, or cut the run there")


def errors(
    vehicle: AbstractVehicle, runs: Runs, shown: Float[Array, "1 k c"]
) -> tuple[dict[str, dict[str, Any]], Assessment]:
    """The tests of the simulation error, and by measured channel its samples, unit, rms in SI units, the file's σ and
    rms/σ, the latter where σ is stated."""
    layout = vehicle.layout
    error = residual_outputs(vehicle, runs, shown)
    rms = channel_rms(error, runs, layout.channels)
    known = [one.sigma is not None for one in layout.outputs]
    sigma = np.array([rms[one.name] or 1.0 if one.sigma is None else one.sigma for one in layout.outputs])
    assessment = assess_residuals(layout.channels, np.asarray(error) / sigma, np.asarray(runs.mask), known=known)
    stated = {one.name: one.sigma for one in layout.outputs}
    table = {
        one.channel: {
            "samples": one.samples,
            "unit": layout.unit(one.channel),
            "rms": rms[one.channel],
            "sigma": stated[one.channel],
            "rms_over_sigma": one.rms if one.known else None,
            "white_p_value": one.white,
        }
        for one in assessment.channels
    }
    return table, assessment


def unexplained(assessment: Assessment, where: str) -> list[Finding]:
    """A warning, unless the model explains the run or nothing of it was measured."""
    if not assessment.channels or assessment.explains:
        return []
    what = f"the model does not explain this run: {assessment.reason()}"
    return [
        Finding("unexplained-runs", "warning", where, what, "fit it by `jaxsub identify`, or try `jaxsub diagnose`")
    ]


def answer(vehicle: AbstractVehicle, recording: Recording, shown: Float[np.ndarray, "k c"], out: Path) -> Recording:
    """The recording's inputs with the model's outputs."""
    layout = vehicle.layout
    table = {name: recording.column(name) for name in (*layout.held, *layout.interpolated)}
    table |= recorded_columns(layout.outputs, shown)
    return Recording(out.stem, recording.times, table, str(out))


_SAID: dict[Start, str] = {
    "rest": "The model starts at rest",
    "recorded": "The model starts from the first samples, and at rest where nothing is measured",
    "estimated": "The model starts from the initial state estimated from the whole recording",
}


def show(began: Start, state: dict[str, Any], fit: dict[str, dict[str, Any]]) -> None:
    """The initial state and the table of errors on standard output."""
    terminal.say(f"{_SAID[began]}: {', '.join(f'{name} {float(value):.4g}' for name, value in state.items())} (SI).")
    if not fit:
        return
    rows = []
    for channel, one in fit.items():
        stated = one["sigma"] is not None
        over = (f"{one['sigma']:.4g}", f"{one['rms_over_sigma']:.2f}") if stated else ("not stated", "")
        rows.append((channel, str(one["samples"]), f"{one['rms']:.4g}", unit(one["unit"]), *over))
    terminal.table(("channel", "samples", "rms error", "unit", "σ", "rms/σ"), rows)
