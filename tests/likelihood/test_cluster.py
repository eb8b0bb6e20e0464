"""Shares of runs on a Dask cluster, a worker of which is killed at its work, give what this machine gives."""

import os
import signal
import threading

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from clusters import at_work, distributed, two_workers
from rigs import oscillator, recorded

from jaxsub.estimate import estimate_disturbance
from jaxsub.likelihood import Disturbance, blocks, filter_runs, output_errors, part_products, run_shares
from jaxsub.workers import working_on


@pytest.fixture
def cluster(tmp_path_factory, monkeypatch):
    with two_workers(tmp_path_factory.mktemp("cache"), monkeypatch) as started:
        yield started


class Killer(threading.Thread):
    """Kills the first worker that is at a task."""

    def __init__(self, cluster):
        super().__init__(daemon=True)
        self.cluster, self.at = cluster, ()

    def run(self):
        with distributed.Client(self.cluster, set_as_default=False) as client:
            pid, self.at = at_work(client)
            os.kill(pid, signal.SIGKILL)


def answers(runs):
    """What is summed over five runs, by all that a cluster takes part in."""
    vehicle, start, std, sigma = oscillator(), jnp.zeros((5, 2)), jnp.array([0.1, 0.1]), jnp.array([0.01, 0.02])
    followed = filter_runs(vehicle, runs, sigma, Disturbance(np.ones(1), np.ones(1), np.ones(2)), start, std)
    one, nothing = Disturbance(np.ones(1), np.full(1, 2.0), np.ones(2)), np.zeros((1, 1))
    disturbance = estimate_disturbance(followed.system, followed.residual, nothing, one)
    parts = part_products(one, followed.system, lambda some: run_shares.share_of(followed.theta, some), 4)
    model = blocks.BlockLinearised.of(vehicle, runs, start, sigma, std)
    return followed, disturbance, parts, model.products, model.error, output_errors(vehicle, runs, start)


@pytest.mark.long
def test_a_killed_worker_loses_nothing(cluster, monkeypatch):
    """Claim: five runs in three shares, a worker killed at the first of them, give every number of this machine."""
    monkeypatch.setattr(run_shares, "_SAMPLES", 250)
    runs = recorded(oscillator(), 5, 101, 0.1, seed=5, amplitude=1.0)
    here, killer = answers(runs), Killer(cluster)
    killer.start()
    with working_on(cluster.scheduler_address):
        there = answers(runs)
    killer.join(timeout=60.0)
    assert not killer.is_alive() and killer.at
    for one, other in zip(*map(jax.tree.leaves, (there, here)), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9 * (1e-3 + np.max(np.abs(np.asarray(other)))))
