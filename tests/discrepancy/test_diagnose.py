"""Diagnosis names what was concealed, shows it on unseen runs, is silent on clean ones, and admits ignorance."""

import dataclasses
import tomllib
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from diagnosis_cases import INTERVAL, SAMPLES, SMALL, disturbed, recorded, require_named, wrong

from jaxsub.discrepancy import diagnose
from jaxsub.discrepancy.explain.locate import traces
from jaxsub.discrepancy.explain.next_run import next_run, sentence
from jaxsub.discrepancy.linearise.view import look
from jaxsub.effects import AbstractForce
from jaxsub.effects.base import amplitude
from jaxsub.effects.hull import CrossflowDrag, HullAsymmetry
from jaxsub.effects.sensors import SensorScale
from jaxsub.estimate import fit
from jaxsub.vehicle import vehicle_from, vehicle_text
from jaxsub.vehicle.catalogue import dsrv


class LayerForce(AbstractForce):
    """A heave force that comes and goes with depth: no effect of the vocabulary does."""

    name: ClassVar[str] = "layer-force"
    family: ClassVar[str] = "test"
    size: object = amplitude("N")

    @classmethod
    def candidates(cls, facts):
        return []

    @property
    def where(self):
        return ("heave",)

    @property
    def expression(self):
        return "a sin(0.4 z)"

    def force(self, motion):
        return {"heave": self.size * jnp.sin(0.4 * motion.positions["z"])}


def run(effect, vocabulary=None):
    runs = recorded(effect, 5)
    return diagnose(wrong(), runs[:2], runs[2:], vocabulary=vocabulary)


@pytest.mark.long
@pytest.mark.parametrize(
    ("effect", "vocabulary"),
    # of the fourth it is asked where its programs are counted
    [(CrossflowDrag("vertical", 5.0, 0.761, 0.3), of) for of in (None, SMALL)] + [(SensorScale("q", 0.05), None)],
)
def test_names_locates_and_improves(effect, vocabulary):
    """Claim: named where it acts, within four standard errors, with the test run at the noise."""
    require_named(run(effect, vocabulary)[0], effect)


@pytest.mark.long
@pytest.mark.parametrize("effect", [CrossflowDrag("vertical", 5.0, 0.761, 0.3), SensorScale("q", 0.05)])
def test_the_improved_vehicle_file_leaves_nothing_out(effect):
    """Claim: the improved vehicle, written and read again, is diagnosed on the same runs and answered by none."""
    _, improved = run(effect)
    again = vehicle_from(tomllib.loads(vehicle_text(improved)), "improved")
    runs = recorded(effect, 5)
    assert diagnose(again, runs[:2], runs[2:])[0].verdict == "none"


def test_nothing_concealed_is_none():
    """Claim: clean runs have no mismatch, in no place, nothing is fitted to them, and the file's priors are its own."""
    found, improved = run(None)
    assert [row.prior_std for row in improved.layout.free] == [row.prior_std for row in wrong().layout.free]
    assert (found.verdict, found.physics, found.where) == ("none", [], [])
    assert found.p_value > 0.01
    assert found.fit["held_out"]["baseline"] == found.fit["held_out"]["improved"]
    assert [*found.remains] == ["baseline"] and found.gain is None
    assert next_run(found, recorded(None, 5)[:2]) is None


@pytest.mark.long
@pytest.mark.parametrize("lengths", [0.5, 2.0])
def test_a_slow_random_force_is_no_effect(lengths):
    """Claim: forces that hardly change in a run, many times what is seen of depth, have no name in ten records."""
    for seed in range(10):
        runs = disturbed(lengths * SAMPLES * INTERVAL, (0.5, 1.5), seed)
        found, _ = diagnose(wrong(), runs[:2], runs[2:])
        assert found.physics == []


@pytest.mark.long
def test_random_forces_far_above_the_noise_are_no_missing_effect():
    """Claim: where random forces make the test run's error 25 σ nothing is named, and the verdict says that they do."""
    runs = disturbed(3.0, (40.0, 120.0), 1)
    found, _ = diagnose(wrong(), runs[:2], runs[2:], vocabulary=SMALL)
    assert (found.verdict, found.physics) == ("none", [])
    assert max(found.explained.left.values()) > 10.0
    for channel, rms in found.explained.left.items():
        assert 0.4 < rms / found.explained.random[channel] < 2.0
    assert "random disturbance forces leave" in found.summary


@pytest.mark.long
def test_near_twins_are_ambiguous_with_their_rivals():
    """Claim: an asymmetry hardly told from its twins has them as rivals, and the next run is planned to part them.

    A moment that is the same in every run is no slow random one.
    """
    effect = HullAsymmetry("pitch", 1.5)
    found, _ = run(effect)
    names = {physics.effect for physics in found.physics}
    rivals = {rival.effect for physics in found.physics for rival in physics.rivals}
    assert found.verdict == "ambiguous"
    assert "hull-asymmetry" in names | rivals
    assert found.next_manoeuvre
    planned = next_run(found, recorded(effect, 5)[:2])
    assert planned is not None
    assert planned.separation > planned.before
    assert f"apart by {planned.separation:.3g} (χ²" in sentence(planned, "next.csv")
    assert planned.within <= 1.0 + 1e-9


@pytest.mark.parametrize("vocabulary", [pytest.param(None, marks=pytest.mark.long), SMALL])
def test_outside_the_vocabulary_is_unknown_and_located(vocabulary):
    """Claim: a force that no effect is alike is unknown, put into its equation, and beyond its band."""
    found, _ = run(LayerForce(400.0), vocabulary)
    assert found.verdict == "unknown"
    assert found.physics == []
    assert found.p_value < 1e-6
    assert found.where[0].where == "heave"
    trace = found.forces[0]
    assert np.max(np.abs(trace.force["heave"]) / trace.band["heave"]) > 3.0


def test_the_located_force_is_the_one_that_acts():
    """Claim: the smoothed force of the located equation goes with what acts, by a correlation above 0.8."""
    effect = LayerForce(400.0)
    runs = recorded(effect, 5)[:2]
    rows = tuple(dataclasses.replace(row, free=False) for row in dsrv().layout.parameters)
    known = dataclasses.replace(dsrv(), layout=dataclasses.replace(dsrv().layout, parameters=rows))
    found = fit(known, runs)
    view = look(found)
    assert int(jnp.argmax(view.disturbance.force / jnp.array([100.0, 100.0]))) == 0
    for trace, recording in zip(traces(view, runs), runs, strict=True):
        truth = np.interp(trace.times, recording.times, 400.0 * np.sin(0.4 * recording.column("z")))
        assert np.corrcoef(truth, trace.force["heave"])[0, 1] > 0.8


@pytest.mark.long
def test_missing_samples_change_nothing_but_the_precision():
    """Claim: with three samples in ten gone from every channel the same effect is named."""
    effect = SensorScale("q", 0.05)
    runs = list(recorded(effect, 5))
    rng = np.random.default_rng(2)
    thinned = []
    for recording in runs:
        columns = dict(recording.columns)
        for channel in ("w", "q", "theta", "z"):
            gaps = rng.random(len(recording.times)) < 0.3
            columns[channel] = np.where(gaps, np.nan, columns[channel])
        thinned.append(type(recording)(recording.name, recording.times, columns, recording.source))
    found, _ = diagnose(wrong(), thinned[:2], thinned[2:])
    assert [physics.effect for physics in found.physics] == ["sensor-scale"]


def test_effects_are_modules_that_survive_the_jit():
    """Claim: a user's own effect goes through a compiled function as its numbers do."""
    effect = LayerForce(2.0)
    leaves = eqx.filter_jit(lambda e: e.size * 2.0)(effect)
    assert float(leaves) == 4.0
