"""First and second derivatives of a linear body's velocities are those of the paper's sensitivity equations, eq. 3.

Eq. 3 is written out here in NumPy. Its right-hand sides are linear in x and its derivatives, so they are one linear
system, sampled exactly by a matrix exponential: nothing is differentiated by machine or by differences.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from rigs import driven, stacked
from scipy.linalg import expm

from jaxsub.simulation import simulate
from jaxsub.vehicle.catalogue import dsrv

# damping, control and added mass
NAMES = ("Z_w", "M_q", "Z_q", "M_delta_s", "Z_wdot", "M_wdot", "M_qdot")
EQUATION, VARIABLE = {"Z": 0, "M": 1}, {"w": 0, "q": 1}
SAMPLES = 25


def place(name):
    """Which of M̃, Ã, B̃ an entry's derivative is in, and that derivative: (2, 2), (2, 2) and (2,)."""
    inertia, damping, control = np.zeros((2, 2)), np.zeros((2, 2)), np.zeros(2)
    row, variable = EQUATION[name[0]], name[2:]
    if variable.endswith("dot"):
        inertia[row, VARIABLE[variable[0]]] = -1.0
    elif variable.startswith("delta"):
        control[row] = 1.0
    else:
        damping[row, VARIABLE[variable]] = 1.0
    return inertia, damping, control


def matrices(values):
    """M̃, Ã and B̃ of heave and pitch by the appendix of the paper, in the catalogue's numbers."""
    m, speed = values["mass"], values["speed"]
    inertia = np.array(
        [[m - values["Z_wdot"], -values["Z_qdot"]], [-values["M_wdot"], values["I_y"] - values["M_qdot"]]]
    )
    damping = np.array([[values["Z_w"], values["Z_q"] + m * speed], [values["M_w"], values["M_q"]]])
    return inertia, damping, np.array([values["Z_delta_s"], values["M_delta_s"]])


def derivatives(values):
    """A = M̃⁻¹Ã and B = M̃⁻¹B̃, and their first and second derivatives by the coefficients.

    M̃A = Ã gives M̃ A' = Ã' - M̃' A; once more, with M̃, Ã linear in the coefficients, M̃ A'' = -(M̃₁ A₂ + M̃₂ A₁).
    """
    mass, damping, control = matrices(values)
    F = np.linalg.solve(mass, np.column_stack([damping, control]))
    first, second = [], []
    places = [place(name) for name in NAMES]
    for dM, dA, dB in places:
        first.append(np.linalg.solve(mass, np.column_stack([dA, dB]) - dM @ F))
    for dM1, F1 in zip((p[0] for p in places), first, strict=True):
        second.append([-np.linalg.solve(mass, dM1 @ F2 + p[0] @ F1) for p, F2 in zip(places, first, strict=True)])
    return F, first, second


def by_eq_3(values, force, dt):
    """x_k (K, 2), its first derivatives (K, 2, p) and its second (K, 2, p, p), of the body at rest at first."""
    F, first, second = derivatives(values)
    p, K, none = len(NAMES), len(force), np.zeros((2, 2))
    x, by_one, by_two = np.zeros((K, 2)), np.zeros((K, 2, p)), np.zeros((K, 2, p, p))
    for i in range(p):
        for j in range(i, p):
            A, A1, A2, A12 = (part[:, :2] for part in (F, first[i], first[j], second[i][j]))
            # the system [x, x_i, x_j, x_ij, u]: u is held
            block = np.zeros((9, 9))
            block[:8, :8] = np.block(
                [[A, none, none, none], [A1, A, none, none], [A2, none, A, none], [A12, A2, A1, A]]
            )
            block[:8, 8] = np.concatenate([part[:, 2] for part in (F, first[i], first[j], second[i][j])])
            step = expm(block * dt)
            state = np.zeros(9)
            for k in range(1, K):
                state[8] = force[k - 1]
                state = step @ state
                x[k], by_one[k, :, i], by_one[k, :, j] = state[:2], state[2:4], state[4:6]
                by_two[k, :, i, j] = by_two[k, :, j, i] = state[6:8]
    return x, by_one, by_two


@pytest.fixture(scope="module")
def case():
    """The DSRV, a run of held stern plane motion, and what eq. 3 says of it."""
    vehicle = dsrv()
    runs = stacked(vehicle, [driven(vehicle, 0.25 * np.arange(SAMPLES), seed=8, amplitude=0.2, hold=4)])
    values = {name: float(value) for name, value in vehicle.values().items()}
    return vehicle, runs, by_eq_3(values, np.asarray(runs.signals[0, :, 0]), 0.25)


def velocities(vehicle, runs):
    """The measured w and q as a function of the coefficients relative to their own values."""
    own = vehicle.values()

    def of(theta):
        moved = vehicle.with_values({name: own[name] * (1.0 + t) for name, t in zip(NAMES, theta, strict=True)})
        return simulate(moved, runs, jnp.zeros((1, 4)))[0, :, :2]

    return of, np.array([float(own[name]) for name in NAMES])


def test_matrices_of_the_oracle_are_the_vehicle_s_and_every_coefficient_moves_the_velocities(case):
    vehicle, _, (_, by_one, _) = case
    mass, damping, _ = matrices({name: float(value) for name, value in vehicle.values().items()})
    np.testing.assert_allclose(mass, vehicle.mass_matrix(), rtol=1e-12)
    np.testing.assert_allclose(damping, vehicle.damping_matrix(), rtol=1e-12)
    assert (np.abs(by_one).max((0, 1)) > 0.0).all()


@pytest.mark.parametrize("mode", ["forward", "reverse"])
def test_first_derivatives_are_those_of_eq_3(case, mode):
    vehicle, runs, (x, by_one, _) = case
    of, own = velocities(vehicle, runs)
    at = jnp.zeros(len(NAMES))
    np.testing.assert_allclose(of(at), x, rtol=1e-9, atol=1e-12 * np.abs(x).max())
    found = jax.jit({"forward": jax.jacfwd, "reverse": jax.jacrev}[mode](of))(at)
    _assert_alike(found, by_one * own)


def test_second_derivatives_are_those_of_eq_3(case):
    vehicle, runs, (_, _, by_two) = case
    of, own = velocities(vehicle, runs)
    found = jax.jit(jax.jacfwd(jax.jacfwd(of)))(jnp.zeros(len(NAMES)))
    _assert_alike(found, by_two * np.outer(own, own))


def _assert_alike(found, expected):
    """Equal to 1e-10 of the largest value that each derivative takes in the run."""
    size = np.abs(expected).max((0, 1))
    assert (np.abs(np.asarray(found) - expected).max((0, 1)) <= 1e-10 * size + 1e-15).all()
