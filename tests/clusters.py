"""A Dask cluster of two workers, one of which a test kills."""

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from commands import environment

distributed = pytest.importorskip("distributed")


@contextmanager
def two_workers(cache, monkeypatch) -> Iterator["distributed.LocalCluster"]:
    """Two worker processes, which a nanny starts again where they die."""
    for name, value in environment(cache).items():
        monkeypatch.setenv(name, value)
    settings = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": ":0", "silence_logs": 50}
    with distributed.LocalCluster(processes=True, **settings) as started:
        yield started


def at_work(client) -> tuple[int, tuple]:
    """The process of the first worker that is at a task, and its tasks."""
    pids, tasks = client.run(os.getpid), ()
    while not tasks:
        time.sleep(0.02)
        worker, tasks = max(client.processing().items(), key=lambda item: len(item[1]))
    return pids[worker], tasks
