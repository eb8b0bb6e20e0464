"""What is taken first, what stands beside its twins, and what is said of those that a fit was asked of."""

import numpy as np
import pytest

from jaxsub.discrepancy import diagnose
from jaxsub.discrepancy.name import Named, refitted
from jaxsub.effects import AbstractEffect
from jaxsub.effects.hull import CubicDamping, QuadraticDamping
from jaxsub.effects.mechanisms import CoulombFriction
from jaxsub.recording import Recording
from jaxsub.simulate import sampled_states, synthetic
from jaxsub.vehicle import AbstractVehicle, vehicle_from

RIG = {
    "schema": 1,
    "name": "rig",
    "kind": "mechanism",
    "dof": ["x"],
    "coefficients": {
        "I_x": {"value": 1.0, "fixed": True},
        "D_x": {"value": 0.4, "bounds": [0.0, 10.0]},
        "K_x": {"value": 4.0, "bounds": [0.1, 40.0]},
        "B_x_drive": {"value": 2.0, "bounds": [0.1, 20.0]},
    },
    "inputs": {"drive": "u"},
    "outputs": {"x": {"sigma": 0.005}, "x_rate": {"sigma": 0.01}},
}


def rig() -> AbstractVehicle:
    return vehicle_from(RIG, "rig")


def recorded(effect: AbstractEffect, force: np.ndarray, interval: float, count: int) -> list[Recording]:
    """Runs of the rig with `effect` and one input force."""
    truth = rig().with_effect(effect)
    times = interval * np.arange(len(force))
    blank = Recording("run", times, {"u": force}, "run")
    start = np.zeros((1, 2))
    return [synthetic(truth, [blank], seed=s, start=start, states=sampled_states)[0] for s in range(1, count + 1)]


@pytest.mark.long
def test_twins_that_a_linear_picture_confuses_are_told_apart_by_their_fits():
    """Claim: at one amplitude quadratic damping is named though a linear picture prefers cubic damping to it."""
    force = 0.4 * np.sin(1.6 * 0.2 * np.arange(801))
    runs = recorded(QuadraticDamping("x", -0.5), force, 0.2, 3)
    found, _ = diagnose(rig(), runs[:2], runs[2:])
    assert found.verdict in ("named", "ambiguous")
    assert found.physics[0].effect == "quadratic-damping"
    assert "cubic-damping" in [rival.effect for rival in found.physics[0].rivals]


def test_probabilities_of_twins_are_those_of_their_fits_and_others_keep_theirs():
    """Claim: the share of a group is divided by evidence, and what was not fitted stays as it was."""
    quadratic, cubic, friction = QuadraticDamping("x", -0.5), CubicDamping("x", -0.5), CoulombFriction("x")
    named = Named(3, quadratic, 0.2, [(cubic, 0.6), (friction, 0.2)], [(4, cubic)])
    found = refitted(named, [(quadratic, -100.0), (cubic, -100.0 - np.log(3.0))])
    assert found.probability == pytest.approx(0.6)
    assert {effect.name: p for effect, p in found.rivals} == pytest.approx(
        {"cubic-damping": 0.2, "coulomb-friction": 0.2}
    )
    assert refitted(named, [(cubic, -1.0)]) == named
