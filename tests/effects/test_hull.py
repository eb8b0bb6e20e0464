"""Hull forces are the textbook's: drag dissipates, strips add up to SciPy's integral, Coriolis forces do no work."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from samples import BODY, RIG, motion, sized
from scipy.integrate import quad

from jaxsub.effects import (
    EQUATIONS,
    AsymmetricDamping,
    CoriolisCoupling,
    CoulombFriction,
    CrossflowDrag,
    CubicDamping,
    QuadraticDamping,
    TurningSpeedLoss,
    admissible,
    amplitudes,
    candidates,
)

DRAGS = [e for e in candidates(BODY) if isinstance(e, QuadraticDamping | CubicDamping | CrossflowDrag)]
RUBS = [e for e in candidates(RIG) if isinstance(e, QuadraticDamping | CubicDamping | CoulombFriction)]


@pytest.mark.parametrize("effect", DRAGS + RUBS, ids=lambda effect: effect.label)
def test_admissible_drag_takes_power_out_of_any_motion(effect):
    known = RIG if effect in RUBS else BODY
    now = motion(known, count=500)
    for size in (-0.7, 0.7):
        sizes = [size, *[0.0] * (len(amplitudes(effect)) - 1)]
        power = sum(part * now.rates[equation] for equation, part in sized(effect, sizes).force(now).items())
        allowed = admissible(effect, dict(zip(amplitudes(effect), sizes, strict=True)))
        assert allowed == bool((power <= 1e-12).all())
        assert np.abs(power).max() > 0.0


def test_damping_that_differs_by_direction_leaves_other_terminal_rates():
    """Claim: under 3 N a rig of 2 N s/m runs at 3/(2 + D_a) one way and at 3/(2 - D_a) the other."""
    effect, damping, size = AsymmetricDamping("x"), 2.0, 0.5
    rates = np.array([3.0 / (damping + size), -3.0 / (damping - size)])
    now = motion(RIG, count=2)
    now = dataclasses.replace(now, rates={**now.rates, "x": rates})
    balance = 3.0 * np.sign(rates) - damping * rates + np.asarray(sized(effect, [size]).force(now)["x"])
    np.testing.assert_allclose(balance, 0.0, atol=1e-12)


@pytest.mark.parametrize(("plane", "sign"), [("horizontal", 1.0), ("vertical", -1.0)])
def test_crossflow_drag_is_the_integral_along_the_hull(plane, sign):
    effect = CrossflowDrag(plane, 2.0, 0.2, jnp.asarray(0.8))
    now = motion(BODY, count=6)
    found = effect.force(now)
    across, turning = effect.where
    for i, (v, r) in enumerate(zip(now.rates[across], now.rates[turning], strict=True)):
        strip = lambda x, v=float(v), r=float(r): -0.5 * 1025.0 * 0.2 * 0.8 * abs(v + sign * x * r) * (v + sign * x * r)
        kink = [float(np.clip(-sign * v / r, -1.0, 1.0))]
        side = quad(strip, -1.0, 1.0, points=kink)[0]
        moment = quad(lambda x, strip=strip: sign * x * strip(x), -1.0, 1.0, points=kink)[0]
        # sixteen nodes leave a trace of the kink where the local flow turns
        np.testing.assert_allclose([found[across][i], found[turning][i]], [side, moment], rtol=2e-3, atol=0.2)


@pytest.mark.parametrize(("kind", "number"), [("crossflow-drag", "C_d"), ("hull-compressibility", "kappa")])
def test_an_effect_offered_to_a_vehicle_is_of_its_water(kind, number):
    """Claim: of fresh water, 1000 kg/m³, a vehicle's effects have that density, and forces in its proportion."""
    one = lambda facts: next(effect for effect in candidates(facts) if effect.name == kind)
    now = motion(BODY, count=5)
    fresh, sea = (sized(one(facts), [0.7]).force(now) for facts in (dataclasses.replace(BODY, density=1000.0), BODY))
    for equation, force in fresh.items():
        np.testing.assert_allclose(force, sea[equation] * (1000.0 / 1025.0), rtol=1e-12)
    assert number in amplitudes(one(BODY))


def test_crossflow_drag_without_a_kink_is_exact():
    now = motion(BODY, count=6)
    now.rates["sway"] = 5.0 + now.rates["sway"]
    found = CrossflowDrag("horizontal", 2.0, 0.2, jnp.asarray(0.8)).force(now)
    v, r = now.rates["sway"], now.rates["yaw"]
    half = -0.5 * 1025.0 * 0.2 * 0.8
    np.testing.assert_allclose(found["sway"], half * (2.0 * v**2 + 2.0 / 3.0 * r**2), rtol=1e-12)
    np.testing.assert_allclose(found["yaw"], half * 4.0 / 3.0 * v * r, rtol=1e-12)


def skew(a):
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def fossen(inertia, nu):
    """C(ν) of theorem 3.2 in Fossen (2021)."""
    line, turn = inertia[:3] @ nu, inertia[3:] @ nu
    return np.block([[np.zeros((3, 3)), -skew(line)], [-skew(line), -skew(turn)]])


def along(force, count):
    return np.stack([np.broadcast_to(force[e], count) for e in EQUATIONS], -1)


def test_coriolis_force_is_fossens_and_does_no_work():
    now = motion(BODY, cruise=0.0)
    nu = np.stack([now.rates[e] for e in EQUATIONS], -1)
    found = along(CoriolisCoupling(EQUATIONS, jnp.asarray(1.0)).force(now), len(nu))
    expected = [-fossen(np.asarray(now.inertia), row) @ row for row in nu]
    np.testing.assert_allclose(found, expected, rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(np.sum(found * nu, 1), 0.0, atol=1e-10)


def test_coriolis_coupling_is_what_a_linearisation_at_cruise_leaves_out():
    now = motion(BODY, cruise=1.2)
    inertia, nu = np.asarray(now.inertia), np.stack([now.rates[e] for e in EQUATIONS], -1)
    cruise = np.array([1.2, 0.0, 0.0, 0.0, 0.0, 0.0])
    whole = lambda row: -fossen(inertia, row) @ row
    h = 1e-5
    slope = np.stack([(whole(cruise + h * e) - whole(cruise - h * e)) / (2.0 * h) for e in np.eye(6)], 1)
    left_out = [whole(row) - whole(cruise) - slope @ (row - cruise) for row in nu]
    found = along(CoriolisCoupling(EQUATIONS, jnp.asarray(1.0)).force(now), len(nu))
    np.testing.assert_allclose(found, left_out, rtol=1e-8, atol=1e-8)


def test_squares_of_turning_speed_loss_slow_a_body_down():
    now = motion(BODY)
    squares = [e for e in candidates(BODY) if isinstance(e, TurningSpeedLoss) and e.first == e.second]
    assert len(squares) >= 5
    for effect in squares:
        assert (sized(effect, [-2.0]).force(now)["surge"] <= 0.0).all()
