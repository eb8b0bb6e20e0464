"""A sweep on a Dask cluster loses nothing when a worker process is killed in its middle, and answers as one alone."""

import os
import signal
import socket

import jax
import pytest
from sweep_cases import environment, farthest, plan

from jaxsub.errors import InputError
from jaxsub.sweep import sweep

distributed = pytest.importorskip("distributed")


@pytest.fixture
def cluster(tmp_path_factory, monkeypatch):
    """Two worker processes, which a nanny starts again where they die."""
    for name, value in environment(tmp_path_factory.mktemp("cache")).items():
        monkeypatch.setenv(name, value)
    settings = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None, "silence_logs": 50}
    with distributed.LocalCluster(processes=True, **settings) as started:
        yield started


def test_a_worker_killed_in_the_middle_costs_nothing(cluster, tmp_path):
    killed = []

    def kill_one(done, total):
        """Once the first chunk is kept, kill the process of a worker that is at another."""
        if killed or not 0 < done < total:
            return
        with distributed.Client(cluster) as client:
            at = {worker: keys for worker, keys in client.processing().items() if keys}
            worker = next(iter(at))
            killed.append((done, client.run(os.getpid, workers=[worker])[worker]))
        os.kill(killed[0][1], signal.SIGKILL)

    found = sweep(plan(), tmp_path / "out", cluster=cluster.scheduler_address, progress=kill_one)
    ((done, pid),) = killed
    assert done < 96
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)
    assert bool(found.done.all())
    assert farthest(sweep(plan(), tmp_path / "alone"), found) <= 1e-9


def test_no_scheduler_is_said_in_one_line(tmp_path, monkeypatch):
    monkeypatch.setattr("jaxsub.sweep.cluster._PATIENCE", "1s")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
    with pytest.raises(InputError, match="no scheduler answers"):
        sweep(plan(), tmp_path / "out", cluster=address)
    assert jax.config.jax_enable_x64
