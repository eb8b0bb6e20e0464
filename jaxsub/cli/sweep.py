"""`jaxsub sweep`: Monte-Carlo over initial guesses, noise, vehicles and recordings."""

import dataclasses
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click
import xarray

from ..errors import InputError
from ..plain import to_json
from ..recording import Recording
from ..report import sweep_pictures
from ..sweep import Plan, answered, check_folder, summarised
from ..sweep import sweep as run_sweep
from ..vehicle import AbstractVehicle, read_vehicle
from . import session, terminal
from .output import require_apart, require_replaceable
from .runs import load_runs

_TOGETHER = "all"


@dataclasses.dataclass(frozen=True)
class Asked:
    """What the command line asks for."""

    vehicle: Path
    runs: Sequence[Path]
    starts: int
    spread: float
    noise_seeds: int
    others: Sequence[Path]
    apart: bool
    method: str
    seed: int
    compiled: bool
    cluster: str | None


def run(asked: Asked, out: Path, overwrite: bool) -> None:
    """Do what is missing in `out`, and write `sweep.json` and `figures/` there, beside the store.

    With `overwrite` whatever is there goes, once everything else is found to be in order.
    """
    session.start(long=True)
    require_apart(out, [asked.vehicle, *asked.others, *asked.runs])
    plan = make_plan(asked)
    if overwrite:
        require_replaceable(out, overwrite)
        plan = plan.settled()
        _remove(out)
    else:
        check_folder(out, plan)
    done = [0, 0]
    try:
        with terminal.counted(f"sweeping {', '.join(plan.vehicles)}") as tell:

            def progress(count: int, total: int) -> None:
                done[:] = count, total
                tell(count, total)

            dataset = run_sweep(plan, out, cluster=asked.cluster, progress=progress)
        with terminal.progress("summarising") as say:
            say("basins and figures")
            summary = summarised(plan, dataset)
            _write(summary, dataset, out)
    except KeyboardInterrupt as stop:
        raise click.Abort(
            f"interrupted; {done[0]} of {done[1]} are kept in {out}, and the same command goes on"
        ) from stop
    for case in summary["cases"]:
        _show(case)
    terminal.say(f"{summary['done']} searches in {out}")


def _remove(out: Path) -> None:
    if out.is_dir():
        shutil.rmtree(out)
    else:
        out.unlink(missing_ok=True)


def make_plan(asked: Asked) -> Plan:
    """The plan that was asked for. Raises `InputError` for whatever cannot be read or does not fit."""
    vehicles = _by_stem([asked.vehicle, *asked.others], read_vehicle)
    first = next(iter(vehicles.values()))
    recordings = load_runs(asked.runs, first)
    for other in list(vehicles.values())[1:]:
        load_runs(asked.runs, other)
    if len({recording.name for recording in recordings}) < len(recordings):
        raise InputError(", ".join(map(str, asked.runs)), "two runs have one name", "rename one of the files")
    if asked.noise_seeds:
        recordings = answered(first, recordings)
    sets: dict[str, Sequence[Recording]] = {recording.name: [recording] for recording in recordings}
    return Plan(
        vehicles,
        sets if asked.apart else {_TOGETHER: recordings},
        asked.starts,
        spread=asked.spread,
        noise=range(asked.noise_seeds),
        seed=asked.seed,
        method=asked.method.replace("-", "_"),
        compiled=asked.compiled,
    )


def _by_stem(paths: Sequence[Path], read: Any) -> Mapping[str, AbstractVehicle]:
    named = {path.stem: read(path) for path in paths}
    if len(named) < len(paths):
        raise InputError(", ".join(map(str, paths)), "two vehicle files have one name", "rename one of them")
    return named


def _write(summary: dict, dataset: xarray.Dataset, out: Path) -> None:
    (out / "figures").mkdir(exist_ok=True)
    for picture in sweep_pictures(dataset, summary):
        (out / "figures" / f"{picture.name}.png").write_bytes(picture.png)
    (out / "sweep.json").write_text(to_json(summary), encoding="utf-8")


def _show(case: dict) -> None:
    rate, (low, high) = case["success"], case["success"]["interval"]
    title = f"{case['vehicle']} on {case['recording']}"
    lines = [
        f"{title}: {rate['successes']} of {rate['count']} searches reach the least cost known"
        f" ({100 * rate['share']:.1f} %, 95 % interval {100 * low:.1f} to {100 * high:.1f} %)",
        f"basins found: {case['basins_found']}; "
        + ", ".join(f"{basin['count']} at cost {basin['cost']:.6g}" for basin in case["basins"]),
        "outcomes: " + ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in case["outcomes"].items()),
    ]
    for line in lines:
        terminal.say(line)
    bootstrap = any("spread_over_noise" in told for told in case["coefficients"].values())
    headers, rows = ["coefficient", "best", "standard error", "5 to 95 % of ends"], []
    for name, told in case["coefficients"].items():
        ends = told["percentiles_5_50_95"]
        reach = f"{ends[0]:.6g} to {ends[2]:.6g}" if ends else "none"
        row = [name, _said(told["best"], 6), _said(told["standard_error"], 2), reach]
        rows.append([*row, *([_said(told["spread_over_noise"], 2)] if bootstrap else [])])
    terminal.table([*headers, *(["spread over noise"] * bootstrap)], rows)


def _said(value: float | None, digits: int) -> str:
    return "none" if value is None else f"{value:.{digits}g}"
