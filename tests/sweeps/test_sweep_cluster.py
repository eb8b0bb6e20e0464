"""A sweep on a Dask cluster loses nothing when a worker process is killed in its middle, and answers as one alone."""

import os
import signal
import socket
import threading

import dask
import jax
import pytest
from clusters import at_work, distributed, two_workers
from sweep_cases import farthest, plan

from jaxsub.errors import InputError
from jaxsub.sweeps import sweep


@pytest.fixture
def cluster(tmp_path_factory, monkeypatch):
    with two_workers(tmp_path_factory.mktemp("cache"), monkeypatch) as started:
        yield started


class Killer(threading.Thread):
    """Freezes a worker while it is at a chunk, waits until another chunk is kept, and kills it."""

    def __init__(self, cluster):
        super().__init__(daemon=True)
        self.cluster, self.kept, self.done_then, self.at = cluster, threading.Event(), None, ()

    def run(self):
        # a default client would serve the sweep too
        with distributed.Client(self.cluster, set_as_default=False) as client:
            pid, self.at = at_work(client)
            os.kill(pid, signal.SIGSTOP)
            self.kept.wait(timeout=300.0)
            os.kill(pid, signal.SIGKILL)

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
