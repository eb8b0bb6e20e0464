"""One sweep: what is missing in its folder, done and kept."""

from collections.abc import Callable
from pathlib import Path

import xarray

from .cluster import on_cluster
from .dataset import open_sweep
from .local import on_this_machine
from .plan import Plan
from .store import Store


def sweep(
    plan: Plan,
    folder: str | Path,
    *,
    cluster: str | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> xarray.Dataset:
    """Do what of `plan` is missing in `folder`, and open it.

    `cluster` is the address of a Dask scheduler, or `local` for one that is started here and stopped again; without,
    this process does it on its own devices. `progress` is called with the searches done, and all. Draws and
    chunks are the same either way, so a sweep may be begun on one machine and go on elsewhere.

    Whatever ends the process, chunks that are done stay, and the same call does the others.

    **Raises** `InputError` for a plan that cannot be, for a folder that holds another plan or something else, and as
    `on_cluster` does.
    """
    store, plan = Store.of(Path(folder), plan)
    chunks = plan.chunks()
    missing = store.missing(chunks)
    total = plan.per_case * len(plan.cases)
    done = total - sum(chunk.last - chunk.first for chunk in missing)
    progress(done, total)
    if missing:
        finished = on_this_machine(plan, missing) if cluster is None else on_cluster(plan, missing, cluster)
        for chunk, answers in finished:
            store.write(chunk, answers)
            done += chunk.last - chunk.first
            progress(done, total)
    store.tidy()
    return open_sweep(folder)
