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

import logging
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import jax

from ..errors import InputError
from .plan import Chunk, Plan
from .run import Answers

LOCAL = "local"
_PATIENCE = "5s"
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
    from .worker import Prepared, run_there

    with _client(distributed, address) as client:
        settings = _SAME if address != LOCAL else (*_SAME, *_CACHE)
        plugin = Prepared(plan, {name: getattr(jax.config, name) for name in settings})
        client.register_plugin(plugin)
        # all at once, so that a cluster that grows with its work sees how much there is
        submitted = [client.submit(run_there, plugin.name, chunk, pure=False) for chunk in chunks]
        # it would ask the default client for its loop, which this is not
        for future in distributed.as_completed(submitted, loop=client.loop):
            yield future.result()
            future.release()
        client.unregister_worker_plugin(plugin.name)


def require_cluster(address: str) -> None:
    """Raise `InputError` where there is no `distributed`, or no scheduler at `address`."""
    distributed = _distributed()
    if address != LOCAL:
        with _client(distributed, address):
            pass


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
        with (
            distributed.LocalCluster(processes=True, **settings) as cluster,
            distributed.Client(cluster, set_as_default=False) as client,
        ):
            yield client
        return
    try:
        # a default client would take over whatever this program computes by Dask, and stays so where it finds nobody
        client = distributed.Client(address, timeout=_PATIENCE, set_as_default=False)
    except (OSError, ValueError, LookupError, TypeError) as error:
        remedy = "give the address of a Dask scheduler, such as tcp://10.0.0.1:8786, or local"
        raise InputError(f"--cluster {address}", "no scheduler answers there", remedy) from error
    with client:
        yield client
