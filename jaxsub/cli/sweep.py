"""`jaxsub sweep`: Monte-Carlo over initial guesses, noise, vehicles and recordings."""

import dataclasses
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

import xarray

from ..errors import InputError, OutputError
from ..estimate import require_free
from ..findings import Finding
from ..plain import to_json
from ..recording import Recording
from ..report import sweep_pictures
from ..storage import Manifest, place
from ..sweeps import Plan, Store, answered, check_folder, require_cluster, require_memory, summarised
from ..sweeps import sweep as run_sweep
from ..vehicle import AbstractVehicle, read_vehicle
from . import session, terminal
from .options import options
from .output import claimed, require_apart, require_replaceable
from .runs import checked_runs

_TOGETHER = "all"
_RESULT, _FIGURES = "sweep.json", "figures"


@dataclasses.dataclass(frozen=True)
class Asked:
    """The options of the command line."""

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

    With `overwrite` a sweep that is there stays until the new one is done, in the folder `out`.new beside it.
    """
    session.start(long=True)
    inputs = [asked.vehicle, *asked.others, *asked.runs]
    require_apart(out, inputs)
    with claimed(out) as scratch:
        anew = overwrite and out.exists()
        if anew:
            require_replaceable(out, True, inputs)
        folder = out.with_name(f"{out.name}.new") if anew else out
        plan = make_plan(asked)
        with _in_the_way(folder) if anew else nullcontext():
            check_folder(folder, plan)
            _require_unchanged(folder)
        if asked.cluster is not None:
            require_cluster(asked.cluster)
        summary = _swept(asked, plan, folder)
        if anew:
            _replace(out, folder, scratch, inputs)
        options().kept = f"{out} is complete"
    if not options().json:
        terminal.say(f"{summary['done']} searches in {out}")
    terminal.count(_findings(summary))


@contextmanager
def _in_the_way(folder: Path) -> Iterator[None]:
    """Errors about `folder` with the remedy for one that is to be the new sweep of another path."""
    try:
        yield
    except InputError as error:
        where, what, _ = error.parts
        what = f"{what}; with --overwrite the new sweep is begun there"
        raise InputError(where, what, f"move or remove {folder}, or choose another --out") from error


def _swept(asked: Asked, plan: Plan, folder: Path) -> dict[str, Any]:
    """The summary of the sweep, shown and written to `folder`."""
    again = "the same command goes on"
    options().kept = f"what is done is kept in {folder}, and {again}"
    with terminal.counted(f"sweeping {', '.join(plan.vehicles)}") as tell:

        def progress(done: int, total: int) -> None:
            options().kept = f"{done} of {total} searches are kept in {folder}, and {again}"
            tell(done, total)

        dataset = run_sweep(plan, folder, cluster=asked.cluster, progress=progress)
    with terminal.progress("summarising") as say:
        say("basins and figures")
        summary = summarised(plan, dataset)
    terminal.emit(summary, lambda: _show_all(summary["cases"]))
    _write(summary, dataset, folder)
    return summary


def _findings(summary: dict[str, Any]) -> list[Finding]:
    """A warning for each case whose best estimate does not explain its runs."""
    warning = lambda where, what: Finding("unexplained-runs", "warning", where, what)
    titled = {f"{case['vehicle']} on {case['recording']}": case["assessment"] for case in summary["cases"]}
    return [warning(title, told["verdict"]) for title, told in titled.items() if not told["explains"]]


def _require_unchanged(folder: Path) -> None:
    """Raise `InputError` where a file that the sweep would write again was changed or written by somebody else."""
    manifest = Manifest.of_folder(folder)
    for path in [folder / _RESULT, *(folder / _FIGURES).glob("sweep-*.png")]:
        if os.path.lexists(path) and not manifest.lists(path):
            what = "was not written by jaxsub or has changed since, and would be replaced"
            raise InputError(str(path), what, "move it elsewhere or choose another --out")


def _replace(out: Path, folder: Path, scratch: Path, inputs: Sequence[Path]) -> None:
    """Move the new sweep to `out`, and the old one into `scratch`, with which it goes."""
    try:
        require_replaceable(out, True, inputs)
    except InputError as error:
        where, what, _ = error.parts
        raise OutputError(where, what, f"the new sweep is in {folder}") from error
    place(folder, out, scratch)
    if folder.exists():
        folder.rename(scratch / folder.name)


def make_plan(asked: Asked) -> Plan:
    """The plan of these options. Raises `InputError` for whatever cannot be read or does not fit."""
    vehicles = _by_stem([asked.vehicle, *asked.others], read_vehicle)
    for path, vehicle in zip([asked.vehicle, *asked.others], vehicles.values(), strict=True):
        require_free(vehicle, str(path))
    first = next(iter(vehicles.values()))
    checked = [checked_runs(asked.runs, (), vehicle) for vehicle in vehicles.values()]
    # most findings are of the runs, whatever the vehicle
    terminal.warn(dict.fromkeys(finding for each in checked for finding in each.findings))
    recordings = list(checked[0].recordings)
    if len({recording.name for recording in recordings}) < len(recordings):
        raise InputError(", ".join(map(str, asked.runs)), "two runs have one name", "rename one of the files")
    require_memory(vehicles, _sets(recordings, asked.apart), asked.starts, asked.noise_seeds)
    if asked.noise_seeds:
        recordings = answered(first, recordings)
    return Plan(
        vehicles,
        _sets(recordings, asked.apart),
        asked.starts,
        spread=asked.spread,
        noise=range(asked.noise_seeds),
        seed=asked.seed,
        method=asked.method.replace("-", "_"),
        compiled=asked.compiled,
    )


def _sets(recordings: Sequence[Recording], apart: bool) -> dict[str, Sequence[Recording]]:
    """The recordings that are fitted together, by name."""
    return {recording.name: [recording] for recording in recordings} if apart else {_TOGETHER: recordings}


def _by_stem(paths: Sequence[Path], read: Any) -> Mapping[str, AbstractVehicle]:
    named = {path.stem: read(path) for path in paths}
    if len(named) < len(paths):
        raise InputError(", ".join(map(str, paths)), "two vehicle files have one name", "rename one of them")
    return named


def _write(summary: dict, dataset: xarray.Dataset, folder: Path) -> None:
    store = Store(folder, summary["plan"])
    for picture in sweep_pictures(dataset, summary):
        store.keep(folder / _FIGURES / f"{picture.name}.png", picture.png)
    store.keep(folder / _RESULT, to_json(summary).encode())


def _show_all(cases: Sequence[dict]) -> None:
    for case in cases:
        _show(case)


def _show(case: dict) -> None:
    rate, (low, high) = case["success"], case["success"]["interval"]
    title = f"{case['vehicle']} on {case['recording']}"
    among = f"{case['basins_of']} searches" + (
        " with the first seed of noise" if rate["count"] > case["basins_of"] else ""
    )
    lines = [
        f"{title}: the best estimate {case['assessment']['verdict']}",
        f"{title}: {rate['successes']} of {rate['count']} searches reach the least cost known"
        f" ({100 * rate['share']:.1f} %, 95 % interval {100 * low:.1f} to {100 * high:.1f} %)",
        f"basins found: {case['basins_found']} among {among}: "
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
