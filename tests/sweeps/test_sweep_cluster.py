"""A sweep on a Dask cluster loses nothing when a worker process is killed in its middle, and answers as one alone."""

import os
import signal
import socket
import threading
import time

import dask
import jax
import pytest
from commands import environment
from sweep_cases import farthest, plan

from jaxsub.errors import InputError
from jaxsub.sweeps import sweep

distributed = pytest.importorskip("distributed")


@pytest.fixture
def cluster(tmp_path_factory, monkeypatch):
    """Two worker processes, which a nanny starts again where they die."""
    for name, value in environment(tmp_path_factory.mktemp("cache")).items():
        monkeypatch.setenv(name, value)
    settings = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None, "silence_logs": 50}
    with distributed.LocalCluster(processes=True, **settings) as started:
        yield started


class Killer(threading.Thread):
    """Freezes a worker while it is at a chunk, waits until another chunk is kept, and kills it."""

    def __init__(self, cluster):
        super().__init__(daemon=True)
        self.cluster, self.kept, self.done_then, self.at = cluster, threading.Event(), None, ()

    def run(self):
        # a default client would serve the sweep too
        with distributed.Client(self.cluster, set_as_default=False) as client:
            pids = client.run(os.getpid)
            while not self.at:
                time.sleep(0.02)
                worker, self.at = max(client.processing().items(), key=lambda item: len(item[1]))
            os.kill(pids[worker], signal.SIGSTOP)
            self.kept.wait(timeout=300.0)
            os.kill(pids[worker], signal.SIGKILL)

    def progress(self, done, total):
        if done and not self.kept.is_set():
            self.done_then = done
            self.kept.set()


@pytest.mark.long
def test_a_worker_killed_in_the_middle_costs_nothing(cluster, tmp_path):
    alone = sweep(plan(), tmp_path / "alone")
    killer = Killer(cluster)
    killer.start()
    found = sweep(plan(), tmp_path / "out", cluster=cluster.scheduler_address, progress=killer.progress)
    killer.join(timeout=60.0)
    assert not killer.is_alive() and killer.at and killer.done_then == 16
    assert bool(found.done.all())
    assert farthest(alone, found) <= 1e-9


def test_no_scheduler_is_said_in_one_line(tmp_path, monkeypatch):
    monkeypatch.setattr("jaxsub.workers._PATIENCE", "1s")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
    with pytest.raises(InputError, match="no scheduler answers"):
        sweep(plan(), tmp_path / "out", cluster=address)
    assert jax.config.jax_enable_x64
    # nor does what else this process computes by Dask now ask for the scheduler that was not there
    assert dask.config.get("scheduler", None) is None
