"""The covariance of a fit is the scatter of many fits, and a fit of another recording compiles nothing anew."""

import dataclasses
import logging

import jax
import numpy as np
import pytest
from rigs import driven, oscillator, recorded, stacked
from scipy.stats import chi2

from jaxsub.estimate import fit
from jaxsub.estimate.starts import _connected
from jaxsub.results import RESULTS
from jaxsub.simulation import synthetic

FITS = 120


def records(seed, samples=40):
    return recorded(oscillator(), 1, samples, 0.2, seed, amplitude=1.0)


def repeated(count):
    """One experiment `count` times over, each with its own noise."""
    vehicle = oscillator()
    inputs = driven(vehicle, 0.2 * np.arange(40), seed=0, amplitude=1.0)
    runs = stacked(vehicle, synthetic(vehicle, [inputs], seed=0, noise=False))
    noise = np.random.default_rng(1).standard_normal((count, *runs.outputs.shape)) * [0.01, 0.02]
    return [dataclasses.replace(runs, outputs=runs.outputs + draw) for draw in noise]


def test_covariance_is_the_scatter_of_repeated_experiments():
    vehicle = oscillator()
    found = [fit(vehicle, runs) for runs in repeated(FITS)]
    assert all(bool(one.result == RESULTS.successful) for one in found)
    truth = np.array([float(vehicle.values()[name]) for name in found[0].names])
    error = np.array([list(one.values.values()) for one in found]) - truth
    claimed = np.mean([one.covariance for one in found], 0)
    ratio = np.mean(error**2, 0) / np.diag(claimed)
    low, high = chi2.ppf([5e-4, 1.0 - 5e-4], FITS) / FITS
    assert (low < ratio).all()
    assert (ratio < high).all()
    assert (np.abs(error.mean(0)) < 4.0 * np.sqrt(np.diag(claimed) / FITS)).all()
    distance = np.einsum("fp,fpq,fq->f", error, np.linalg.inv([one.covariance for one in found]), error)
    low, high = chi2.ppf([5e-4, 1.0 - 5e-4], FITS * len(truth))
    assert low < distance.sum() < high


def test_a_second_recording_of_the_same_shape_compiles_nothing(caplog):
    vehicle = oscillator()
    fit(vehicle, records(1))

    def compiled(samples):
        caplog.clear()
        runs = records(2, samples)
        with caplog.at_level(logging.WARNING), jax.log_compiles():
            fit(vehicle, runs)
        return [record.message for record in caplog.records if record.message.startswith("Compiling")]

    assert compiled(40) == []
    assert compiled(41) != []


@pytest.mark.parametrize("pairs", [10**9, 2000])
def test_ends_are_clustered_alike_with_and_without_a_grid(monkeypatch, pairs):
    monkeypatch.setattr("jaxsub.estimate.starts._PAIRS", pairs)
    rng = np.random.default_rng(0)
    chain = np.column_stack([0.5 * np.arange(60), np.zeros(60), np.zeros(60)])
    balls = [centre + 0.05 * rng.normal(size=(400, 3)) for centre in ([100.0, 0, 0], [0, 100.0, 0])]
    points = np.concatenate([chain, *balls, [[300.0, 0, 0]]])
    label = _connected(points)
    assert [len(set(label[:60])), len(set(label[60:460])), len(set(label[460:860]))] == [1, 1, 1]
    assert len(set(label)) == 4
