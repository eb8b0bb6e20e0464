"""What a Dask worker runs: imported on a cluster's machines, and where a sweep is given to one."""

import pickle
from collections.abc import Mapping
from typing import Any

import jax
from distributed import WorkerPlugin, get_worker

from ..workers import versions
from .description import described, name_of
from .plan import Chunk, Plan
from .run import Answers, run_chunks


class Prepared(WorkerPlugin):
    """What a worker does as it joins, one that takes the place of a dead one included: JAX's `settings`, the plan.

    The plan travels packed, since its numbers would be cut to single precision were they unpacked before the settings.
    """

    def __init__(self, plan: Plan, settings: Mapping[str, Any]):
        self.name = f"jaxsub-sweep-{name_of(described(plan))[:16]}"
        self.settings, self.versions, self.packed = dict(settings), versions(), pickle.dumps(plan)

    def setup(self, worker: Any) -> None:
        """Called by Dask in the worker. Raises `RuntimeError` where that has other versions than the sweep."""
        if versions() != self.versions:
            raise RuntimeError(f"the sweep has {self.versions} and this worker {versions()}: install the same")
        for name, value in self.settings.items():
            jax.config.update(name, value)
        self.plan = pickle.loads(self.packed)


def run_there(name: str, chunk: Chunk) -> tuple[Chunk, Answers]:
    """A task: the chunk, by the plan that the worker was given under `name`."""
    prepared: Any = get_worker().plugins[name]
    return chunk, run_chunks(prepared.plan, [chunk])[0]
