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

from collections.abc import Iterator, Sequence

from ..workers import connected, distributed, settings_for
from .plan import Chunk, Plan
from .run import Answers


def on_cluster(plan: Plan, chunks: Sequence[Chunk], address: str) -> Iterator[tuple[Chunk, Answers]]:
    """Each chunk and its answers, as they are done by the cluster at `address`, or by one that is started on `local`.

    **Raises** `InputError` where there is no `distributed`, or no scheduler at `address`; `distributed.KilledWorker`
    for a chunk that four workers died of.
    """
    dask = distributed()
    from .worker import Prepared, run_there

    with connected(address) as client:
        plugin = Prepared(plan, settings_for(address))
        client.register_plugin(plugin)
        # all at once, so that a cluster that grows with its work sees how much there is
        submitted = [client.submit(run_there, plugin.name, chunk, pure=False) for chunk in chunks]
        # it would ask the default client for its loop, which this is not
        for future in dask.as_completed(submitted, loop=client.loop):
            yield future.result()
            future.release()
        client.unregister_worker_plugin(plugin.name)
