"""A sweep on a Dask cluster: the same chunks, each a task of its own.

Workers are given the plan once, as they join, and set to the precision that this process has before they unpack it. A
worker that dies takes one chunk with it, which Dask gives to another; this process alone writes to the store.

On a machine under SLURM, with `pip install 'jaxsub[cluster]' dask-jobqueue`, start workers of one thread from a login
node or a small job, and hand their scheduler to the sweep:

    from dask_jobqueue import SLURMCluster

    cluster = SLURMCluster(cores=16, processes=16, memory="32GB", walltime="04:00:00", queue="compute")
    cluster.adapt(maximum_jobs=20)
    sweep(plan, "out", cluster=cluster.scheduler_address)

or print `cluster.scheduler_address` and leave it running for `jaxsub sweep … --cluster ADDRESS`. A job that reaches its
time limit is a worker that dies, which costs the chunks that it was at.
"""

import itertools
import logging
import pickle
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import jax

from ..errors import InputError
from .described import described, name_of
from .plan import Chunk, Plan
from .run import Answers, run_chunks

LOCAL = "local"
_PATIENCE = "15s"
# chunks on their way for each thread of the cluster: enough that none waits, few enough that memory is bounded
_AHEAD = 3
# settings of this process that every worker takes over, and those that one on the same machine can
_SAME = ("jax_enable_x64",)
_CACHE = (
    "jax_compilation_cache_dir",
    "jax_persistent_cache_min_compile_time_secs",
    "jax_persistent_cache_min_entry_size_bytes",
)


def on_cluster(plan: Plan, chunks: Sequence[Chunk], address: str) -> Iterator[tuple[Chunk, Answers]]:
    """Each chunk and its answers, as they are done by the cluster at `address`, or by one that is started on `local`.

    **Raises** `InputError` where there is no `distributed`, or no scheduler at `address`; `distributed.KilledWorker`
    for a chunk that four workers died of.
    """
    distributed = _distributed()
    with _client(distributed, address) as client:
        plugin = _plugin(distributed, plan, _SAME if address != LOCAL else (*_SAME, *_CACHE))
        client.register_plugin(plugin)
        waiting = iter(chunks)
        submit = lambda chunk: client.submit(_run_there, plugin.name, chunk, key=f"{plugin.name}-{_key(chunk)}")
        ahead = _AHEAD * max(1, sum(client.nthreads().values()))
        running = distributed.as_completed([submit(chunk) for chunk in itertools.islice(waiting, ahead)])
        for future in running:
            yield future.result()
            future.release()
            for chunk in itertools.islice(waiting, 1):
                running.add(submit(chunk))
        client.unregister_worker_plugin(plugin.name)


def _distributed() -> Any:
    try:
        import distributed
    except ImportError as error:
        raise InputError("--cluster", "needs Dask", "pip install 'jaxsub[cluster]'") from error
    return distributed


@contextmanager
def _client(distributed: Any, address: str) -> Iterator[Any]:
    if address == LOCAL:
        settings = {"threads_per_worker": 1, "dashboard_address": None, "silence_logs": logging.ERROR}
        with distributed.LocalCluster(processes=True, **settings) as cluster, distributed.Client(cluster) as client:
            yield client
        return
    try:
        client = distributed.Client(address, timeout=_PATIENCE)
    except (OSError, ValueError) as error:
        remedy = "give the address of a Dask scheduler, such as tcp://10.0.0.1:8786, or local"
        raise InputError(f"--cluster {address}", "no scheduler answers there", remedy) from error
    with client:
        yield client


def _plugin(distributed: Any, plan: Plan, settings: Sequence[str]) -> Any:
    """What every worker does as it joins, those that take the place of a dead one included."""

    class Prepared(distributed.WorkerPlugin):
        def __init__(self) -> None:
            self.name = f"jaxsub-sweep-{name_of(described(plan))[:16]}"
            self.settings = {name: getattr(jax.config, name) for name in settings}
            self.packed = pickle.dumps(plan)

        def setup(self, worker: Any) -> None:
            for name, value in self.settings.items():
                jax.config.update(name, value)
            self.plan = pickle.loads(self.packed)

    return Prepared()


def _run_there(name: str, chunk: Chunk) -> tuple[Chunk, Answers]:
    """A task: the chunk, by the plan that the worker was given."""
    from distributed import get_worker

    prepared: Any = get_worker().plugins[name]
    return chunk, run_chunks(prepared.plan, [chunk])[0]


def _key(chunk: Chunk) -> str:
    return f"{chunk.case}-{chunk.first}"
