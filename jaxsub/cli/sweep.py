"""`jaxsub sweep`: Monte-Carlo over initial guesses, noise, vehicles and recordings."""

import dataclasses
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

from ..api.sweeps import FIGURES, RESULT, Sweep, planned
from ..errors import InputError, OutputError
from ..estimate import require_free
from ..findings import Finding
from ..storage import Manifest, place
from ..sweeps import Plan, check_folder, summarised
from ..sweeps import sweep as run_sweep
from ..vehicle import AbstractVehicle, read_vehicle
from ..workers import require_cluster
from . import session, terminal
from .options import options
from .output import claimed, require_apart, require_replaceable
from .runs import checked_runs


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
        found = Sweep(dataset, summarised(plan, dataset))
    terminal.emit(found.content, lambda: terminal.show(found.parts()))
    found.keep(folder)
    return found.content


def _findings(summary: dict[str, Any]) -> list[Finding]:
    """A warning for each case whose best estimate does not explain its runs."""
    warning = lambda where, what: Finding("unexplained-runs", "warning", where, what)
    titled = {f"{case['vehicle']} on {case['recording']}": case["assessment"] for case in summary["cases"]}
    return [warning(title, found["verdict"]) for title, found in titled.items() if not found["explains"]]


def _require_unchanged(folder: Path) -> None:
    """Raise `InputError` where a file that the sweep would write again was changed or written by somebody else."""
    manifest = Manifest.of_folder(folder)
    for path in [folder / RESULT, *(folder / FIGURES).glob("sweep-*.png")]:
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
    checked = [checked_runs(asked.runs, (), vehicle) for vehicle in vehicles.values()]
    # most findings are of the runs, whatever the vehicle
    terminal.warn(dict.fromkeys(finding for each in checked for finding in each.findings))
    recordings = list(checked[0].recordings)
    return planned(
        vehicles,
        recordings,
        starts=asked.starts,
        spread=asked.spread,
        noise_seeds=asked.noise_seeds,
        apart=asked.apart,
        method=asked.method,
        seed=asked.seed,
        compiled=asked.compiled,
    )


def _by_stem(paths: Sequence[Path], read: Any) -> Mapping[str, AbstractVehicle]:
    named = {path.stem: read(path) for path in paths}
    if len(named) < len(paths):
        raise InputError(", ".join(map(str, paths)), "two vehicle files have one name", "rename one of them")
    return named
