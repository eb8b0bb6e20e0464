"""Actuators of a body against their equations, written here by hand in NumPy."""

import tomllib

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from rigs import driven, stacked
from scipy.integrate import solve_ivp

from jaxsub.effects import EQUATIONS, VELOCITIES
from jaxsub.recording import Recording
from jaxsub.simulation import at_rest, integrate, simulate
from jaxsub.vehicle import vehicle_findings, vehicle_from, vehicle_text

RHO, G = 1025.0, 9.80665
PLACE = [0.3, -0.2, 0.1]
OBLIQUE = [1.0, -1.0, 0.5]
ACROSS = [0.0, -1.0, 0.5]
SCREW = {"kind": "propeller", "input": "n", "position": [-0.9, 0.0, 0.05], "diameter": 0.2, "K_T": [0.3, -0.25, -0.1]}


def hull(actuators, inputs, **changes):
    """Six degrees of freedom without hydrodynamic forces, so that all that acts are the actuators."""
    tree = {
        "schema": 1, "name": "hull", "kind": "submerged-body", "body": {"mass": 60.0, "inertia": [1.0, 12.0, 13.0]},
        "actuators": actuators, "inputs": inputs, "outputs": {name: {"sigma": 0.01} for name in "uvwpqr"},
    }  # fmt: skip
    return vehicle_from(tree | changes, "hull.toml")


def forces(vehicle, nu, attitude, commands):
    """Generalised force (6,) of the actuators alone."""
    state = np.zeros(len(vehicle.layout.states))
    state[:6], state[6:9] = nu, attitude
    motion = vehicle.motion(jnp.asarray(state), jnp.asarray(commands))
    found = vehicle.actuators.force(motion)
    return np.array([float(found.get(e, 0.0)) for e in EQUATIONS])


def wrench(force, place):
    return np.concatenate([force, np.cross(place, force)])


def at(nu, place):
    """Velocity of a point of the body."""
    return nu[:3] + np.cross(nu[3:], place)


def unit(direction):
    return np.array(direction) / np.linalg.norm(direction)


def down(phi, theta):
    return np.array([-np.sin(theta), np.sin(phi) * np.cos(theta), np.cos(phi) * np.cos(theta)])


def quadratic(c, ahead=2.0, astern=1.5):
    return (ahead if c > 0 else astern) * abs(c) * c


def outside(c, low, high):
    """What a dead band leaves of a command."""
    return c - high if c > high else c - low if c < low else 0.0


def foil(nu, delta, place, direction, strength, inflow=True):
    """Flat plate at small angles: the normal velocity of the deflected plate, times its speed ahead."""
    velocity = at(nu, place)
    across = unit(direction) @ velocity if inflow else 0.0
    return strength * abs(velocity[0]) * (velocity[0] * delta - across)


def open_water(nu, omega, wake=0.0):
    n, D = omega / (2 * np.pi), 0.2
    J = (1.0 - wake) * at(nu, SCREW["position"])[0] / (abs(n) * D)
    J *= np.sign(n)
    return np.sign(n) * RHO * n**2 * D**4 * (0.3 - 0.25 * J - 0.1 * J**2)


def mmg(nu, delta, omega):
    """Yasukawa and Yoshimura (2015), eqs. 13-27, in their non-dimensional variables."""
    u, v, r, L, D, n = nu[0], nu[1], nu[5], 7.0, 0.2, omega / (2 * np.pi)
    u_a = at(nu, SCREW["position"])[0]  # the publication has the propeller in the plane of its motions
    U = np.hypot(u, v)
    beta, r_ = np.arctan2(-v, u), r * L / U
    beta_P = beta - (-0.9 / L) * r_
    w = 1.0 - (1.0 - 0.35) * (1.0 + (1.0 - np.exp(-2.0 * abs(beta_P))) * ((1.6 if beta_P > 0 else 1.1) - 1.0))
    J = u_a * (1.0 - w) / (n * D)
    KT = 0.3 - 0.25 * J - 0.1 * J**2
    X_P = (1.0 - 0.22) * RHO * n**2 * D**4 * KT
    beta_R = beta - (-0.71) * r_
    v_R = U * (0.64 if beta_R > 0 else 0.395) * beta_R
    race = 0.626 * (1.0 + 0.5 * (np.sqrt(1.0 + 8.0 * KT / (np.pi * J**2)) - 1.0)) ** 2 + (1.0 - 0.626)
    u_R = 1.09 * u_a * (1.0 - w) * np.sqrt(race)
    F_N = 0.5 * RHO * 0.02 * 2.747 * (u_R**2 + v_R**2) * np.sin(delta - np.arctan(v_R / u_R))
    X = X_P - (1.0 - 0.387) * F_N * np.sin(delta)
    Y = -(1.0 + 0.312) * F_N * np.cos(delta)
    N = -(-1.0 + 0.312 * -3.25) * F_N * np.cos(delta)
    # thrust acts 0.05 m below the origin, the rudder 0.1 m above it
    return np.array([X, Y, 0.0, 0.1 * Y, 0.05 * X_P, N])


RUDDER = {
    "kind": "rudder", "position": [-1.0, 0.0, -0.1], "propeller": "screw", "area": 0.02, "lift_slope": 2.747,
    "t_R": 0.387, "a_H": 0.312, "x_H": -3.25, "epsilon": 1.09, "kappa": 0.5, "eta": 0.626, "l_R": -0.71 * 7.0,
    "gamma_R": [0.395, 0.64],
}  # fmt: skip
DRIFTING = {"wake": 0.35, "C_1": 2.0, "C_2": [1.1, 1.6], "thrust_deduction": 0.22}
TABLE = {"command": [-1.0, -0.2, 0.2, 1.0], "thrust": [-40.0, 0.0, 0.0, 50.0]}

# actuators, the units of inputs that state one, least and largest command, and the force by hand
CASES = {
    "force as command": (
        {"a": {"kind": "thruster", "position": PLACE, "direction": OBLIQUE}}, {}, (-30, 30),
        lambda nu, angles, c: wrench(c[0] * unit(OBLIQUE), PLACE),
    ),
    "gain": (
        {"a": {"kind": "thruster", "position": PLACE, "direction": OBLIQUE, "gain": 40.0}}, {"a": "V"}, (-1, 1),
        lambda nu, angles, c: wrench(40.0 * c[0] * unit(OBLIQUE), PLACE),
    ),
    "quadratic": (
        {"a": {"kind": "thruster", "position": PLACE, "direction": OBLIQUE, "forward": 2.0, "reverse": 1.5,
               "dead_band": [-0.6, 0.4], "limits": [-2.5, 3.0]}}, {"a": "rad/s"}, (-4, 4),
        lambda nu, angles, c: wrench(quadratic(outside(np.clip(c[0], -2.5, 3.0), -0.6, 0.4)) * unit(OBLIQUE), PLACE),
    ),
    "advance": (
        {"a": {"kind": "thruster", "position": PLACE, "direction": OBLIQUE, "forward": 2.0, "advance": 0.3}}, {},
        (-4, 4),
        lambda nu, angles, c: wrench(
            (quadratic(c[0], astern=2.0) - 0.3 * abs(c[0]) * (unit(OBLIQUE) @ at(nu, PLACE))) * unit(OBLIQUE), PLACE
        ),
    ),
    "table about a neutral": (
        {"a": {"kind": "thruster", "position": PLACE, "direction": OBLIQUE, "neutral": 0.3, "thrust": TABLE,
               "gain": 0.8}}, {"a": "1"}, (-1.5, 1.5),
        lambda nu, angles, c: wrench(
            0.8 * np.interp(c[0] - 0.3, TABLE["command"], TABLE["thrust"]) * unit(OBLIQUE), PLACE
        ),
    ),
    "polynomial": (
        {"a": {"kind": "thruster", "position": PLACE, "direction": OBLIQUE, "thrust": [0.5, 10.0, -1.0, 4.0]}}, {},
        (-1.5, 1.5),
        lambda nu, angles, c: wrench((0.5 + 10 * c[0] - c[0] ** 2 + 4 * c[0] ** 3) * unit(OBLIQUE), PLACE),
    ),
    "allocation": (
        {"port": {"kind": "thruster", "position": [0, -0.2, 0], "direction": [1, 0, 0],
                  "input": {"ahead": 0.5, "turn": 0.7}},
         "starboard": {"kind": "thruster", "position": [0, 0.2, 0], "direction": [1, 0, 0],
                       "input": {"ahead": 0.5, "turn": -0.7}}}, {}, (-9, 9),
        lambda nu, angles, c: np.array([c[0], 0, 0, 0, 0, 0.2 * 2 * 0.7 * c[1]]),
    ),
    "fin": (
        {"a": {"kind": "fin", "position": PLACE, "direction": ACROSS, "area": 0.02, "lift_slope": 3.1, "drag": 0.9}},
        {}, (-0.4, 0.4),
        lambda nu, angles, c: wrench(
            foil(nu, c[0], PLACE, ACROSS, 0.5 * RHO * 0.02 * 3.1) * unit(ACROSS), PLACE
        ) + wrench(-0.5 * RHO * 0.02 * 0.9 * (at(nu, PLACE)[0] * c[0]) ** 2 * np.eye(3)[0], PLACE),
    ),
    "fin of a measured hull": (
        {"a": {"kind": "fin", "position": PLACE, "direction": ACROSS, "derivative": 9.6, "inflow": False}}, {},
        (-0.4, 0.4),
        lambda nu, angles, c: wrench(foil(nu, c[0], PLACE, ACROSS, 9.6, inflow=False) * unit(ACROSS), PLACE),
    ),
    "propeller": (
        {"screw": SCREW | {"wake": 0.1, "thrust_deduction": 0.15, "gain": 0.9, "reverse": 0.7}}, {}, (-90, 90),
        lambda nu, angles, c: wrench(
            0.9 * (0.7 if c[0] < 0 else 1.0) * 0.85 * open_water(nu, c[0], 0.1) * np.eye(3)[0], SCREW["position"]
        ),
    ),
    "left-handed propeller with torque": (
        {"screw": SCREW | {"K_Q": {"J": [-1.0, 0.0, 1.0], "K_Q": [0.05, 0.03, 0.0]}, "hand": "left"}}, {}, (-90, -40),
        lambda nu, angles, c: wrench(open_water(nu, c[0]) * np.eye(3)[0], SCREW["position"]) + np.eye(6)[3] * -1.0
        * RHO * (c[0] / 2 / np.pi) ** 2 * 0.2**5
        * np.interp(-at(nu, SCREW["position"])[0] / (abs(c[0]) / 2 / np.pi * 0.2), [-1, 0, 1], [0.05, 0.03, 0.0]),
    ),
    "rudder in the race": (
        {"rudder": RUDDER, "screw": SCREW | DRIFTING}, {}, ((-0.6, 40), (0.6, 90)),
        lambda nu, angles, c: mmg(nu, c[0], c[1]),
    ),
    "buoyancy engine": (
        {"a": {"kind": "ballast", "position": PLACE}}, {}, (-2e-3, 2e-3),
        lambda nu, angles, c: wrench(-RHO * G * c[0] * down(*angles[:2]), PLACE),
    ),
    "tank": (
        {"a": {"kind": "ballast", "of": "mass", "position": PLACE, "gain": 1.1}}, {}, (-2, 2),
        lambda nu, angles, c: wrench(1.1 * G * c[0] * down(*angles[:2]), PLACE),
    ),
    "moving mass": (
        {"a": {"kind": "moving-mass", "direction": [2.0, 0.0, 0.0], "mass": 9.0}}, {}, (-0.1, 0.1),
        lambda nu, angles, c: np.concatenate([np.zeros(3), np.cross([c[0], 0, 0], 9.0 * G * down(*angles[:2]))]),
    ),
}  # fmt: skip


def made(case):
    actuators, units, ends, expected = CASES[case]
    names = dict.fromkeys(name for item in actuators.values() for name in item.get("input", {}) if name != "n")
    names = names if isinstance(next(iter(actuators.values())).get("input"), dict) else actuators
    inputs = {{"screw": "n"}.get(name, name): f"column {name}" for name in names}
    inputs |= {name: {"column": name, "unit": unit} for name, unit in units.items()}
    return hull(actuators, inputs), len(inputs), ends, expected


@pytest.mark.parametrize("case", CASES)
def test_force_is_that_of_the_equation_by_hand(case):
    """Claim: at random motions, attitudes and commands all six components agree to 1e-10 of the largest."""
    vehicle, count, (low, high), expected = made(case)
    draws = np.random.default_rng(list(CASES).index(case))
    for _ in range(12):
        nu, attitude = draws.normal(size=6) * 0.4 + np.eye(6)[0] * 1.5, draws.normal(size=3) * 0.6
        commands = draws.uniform(low, high, size=count)
        hand = expected(nu, attitude, commands)
        np.testing.assert_allclose(
            forces(vehicle, nu, attitude, commands), hand, rtol=1e-10, atol=1e-10 * np.abs(hand).max() + 1e-12
        )


@pytest.mark.parametrize("case", CASES)
def test_actuator_is_differentiable_at_rest_jittable_and_batched(case):
    """Claim: slopes by state, command and numbers are finite with everything at zero; vmap and jit change nothing."""
    vehicle, count, (low, high), _ = made(case)
    state, signals = jnp.zeros(len(vehicle.layout.states)), jnp.zeros(count)
    slopes = jax.jit(jax.jacrev(lambda x, u: vehicle.acceleration(x, u), argnums=(0, 1)))(state, signals)
    by_number = jax.jacfwd(lambda values: vehicle.with_values(values).acceleration(state, signals))(vehicle.values())
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves((slopes, by_number)))
    draws = np.random.default_rng(5)
    states = jnp.asarray(draws.normal(size=(4, len(state))) * 0.3)
    inputs = jnp.asarray(draws.uniform(low, high, size=(4, count)))
    batched = jax.vmap(jax.jit(lambda x, u: vehicle.acceleration(x, u)))(states, inputs)
    np.testing.assert_allclose(batched, vehicle.acceleration(states, inputs), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("case", CASES)
def test_actuators_are_written_as_they_were_read(case):
    """Claim: the file written gives the same accelerations and the same file; no warning that anything is idle."""
    vehicle, count, (low, high), _ = made(case)
    text = vehicle_text(vehicle)
    again = vehicle_from(tomllib.loads(text), "again.toml")
    assert vehicle_text(again) == text
    draws = np.random.default_rng(6)
    states = jnp.asarray(draws.normal(size=(4, len(vehicle.layout.states))) * 0.3)
    inputs = jnp.asarray(draws.uniform(low, high, size=(4, count)))
    np.testing.assert_allclose(
        again.acceleration(states, inputs), vehicle.acceleration(states, inputs), rtol=1e-12, atol=1e-12
    )
    assert not [one for one in vehicle_findings(again, "again.toml") if one.check == "idle-input"]


def test_recorded_density_is_that_of_the_water_and_else_the_reference_density():
    fin = {"kind": "fin", "position": PLACE, "direction": [0, 1, 0], "area": 0.02, "lift_slope": 3.1}
    body = {"mass": 60.0, "inertia": [1.0, 12.0, 13.0], "reference_density": 1000.0}
    fresh = hull({"a": fin}, {"a": "a"}, body=body)
    salt = hull({"a": fin}, {"a": "a"}, body=body, environment={"density": "rho"})
    one, two = (forces(v, np.eye(6)[0], np.zeros(3), c) for v, c in ((fresh, [0.1]), (salt, [0.1, 1030.0])))
    np.testing.assert_allclose(two, 1.03 * one, rtol=1e-12)


# x and y of a thruster, its direction in the horizontal plane, and of the vertical ones
HORIZONTAL = {"t1": (0.16, 0.11, 1, -1), "t2": (0.16, -0.11, 1, 1), "t3": (-0.16, 0.11, 1, 1),
              "t4": (-0.16, -0.11, 1, -1)}  # fmt: skip
VERTICAL = {"t5": (0.12, 0.22), "t6": (0.12, -0.22), "t7": (-0.12, 0.22), "t8": (-0.12, -0.22)}
DRAG = {"X_u|u|": -140.0, "Y_v|v|": -210.0, "Z_w|w|": -190.0, "K_p|p|": -1.2, "M_q|q|": -0.5, "N_r|r|": -1.5,
        "X_u": -14.0, "Z_w": -33.0}  # fmt: skip
ADDED = {"X_udot": -6.4, "Y_vdot": -7.1, "Z_wdot": -18.7, "K_pdot": -0.19, "M_qdot": -0.14, "N_rdot": -0.22}
LAG = 0.15


def rov():
    """Eight thrusters whose commands are volts, with a dead band, a lag and one of them weak."""
    common = {"kind": "thruster", "forward": 0.4, "reverse": 0.3, "dead_band": 0.5, "time_constant": LAG}
    actuators = {
        n: common | {"position": [x, y, 0.08], "direction": [a, b, 0]} for n, (x, y, a, b) in HORIZONTAL.items()
    }
    actuators |= {n: common | {"position": [x, y, 0.0], "direction": [0, 0, -1]} for n, (x, y) in VERTICAL.items()}
    actuators["t3"] |= {"gain": 0.8}
    body = {"mass": 13.5, "inertia": [0.26, 0.23, 0.37], "centre_of_buoyancy": [0.0, 0.0, -0.01], "buoyancy": 133.5}
    shown = (*"uvwpqr", "phi", "theta", "psi", "z")
    return hull(
        actuators, {n: {"column": n, "unit": "V"} for n in actuators}, name="ROV", body=body,
        model={"coriolis": "full"}, coefficients=DRAG | ADDED, outputs={n: {"sigma": 0.01} for n in shown},
    )  # fmt: skip


def rov_rates(x, commands):
    """Rates of [u v w p q r φ θ ψ z] and of the eight lagged commands by Fossen's equations."""
    nu, (phi, theta, _), lagged = x[:6], x[6:9], x[10:]
    M = np.diag([13.5] * 3 + [0.26, 0.23, 0.37]) - np.diag([ADDED[n] for n in ADDED])
    p, h = (M @ nu)[:3], (M @ nu)[3:]
    force = -np.concatenate([np.cross(nu[3:], p), np.cross(nu[3:], h) + np.cross(nu[:3], p)])
    for name, value in DRAG.items():
        i = "XYZKMN".index(name[0])
        force[i] += value * nu[i] * (abs(nu[i]) if "|" in name else 1.0)
    W, B = 13.5 * G, 133.5
    force += np.concatenate([(W - B) * down(phi, theta), np.cross([0.0, 0.0, -0.01], -B * down(phi, theta))])
    for name, volt in zip((*HORIZONTAL, *VERTICAL), lagged, strict=True):
        push = (0.8 if name == "t3" else 1.0) * quadratic(outside(volt, -0.5, 0.5), 0.4, 0.3)
        if name in HORIZONTAL:
            a, b, *d = HORIZONTAL[name]
            force += wrench(push * unit([*d, 0.0]), [a, b, 0.08])
        else:
            force += wrench(push * np.array([0.0, 0.0, -1.0]), [*VERTICAL[name], 0.0])
    u, v, w, p, q, r = nu
    turning = (q * np.sin(phi) + r * np.cos(phi)) / np.cos(theta)
    attitude = [p + turning * np.sin(theta), q * np.cos(phi) - r * np.sin(phi), turning]
    sinking = -u * np.sin(theta) + (v * np.sin(phi) + w * np.cos(phi)) * np.cos(theta)
    return np.concatenate([np.linalg.solve(M, force), attitude, [sinking], (commands - lagged) / LAG])


@pytest.mark.parametrize("solver", ["reference", pytest.param("sampled", marks=pytest.mark.long)])
def test_rov_of_eight_thrusters_moves_by_fossen_s_equations(solver):
    """Claim: in two and a half seconds of random volts no state differs by 1e-6 from a SciPy integration."""
    vehicle, times = rov(), 0.01 * np.arange(251)
    columns = dict(driven(vehicle, times, seed=2, amplitude=3.0, hold=30).columns)
    runs = stacked(vehicle, [Recording("run", times, columns, "run")], substeps=4)
    if solver == "reference":
        found, names = integrate(vehicle, runs, at_rest(vehicle, 1), rtol=1e-11, atol=1e-11)[0], vehicle.layout.states
    else:
        found, names = simulate(vehicle, runs, at_rest(vehicle, 1))[0], vehicle.layout.channels
    commands = np.stack([columns[name] for name in vehicle.layout.held], axis=1)
    state = np.concatenate([np.zeros(10), commands[0]])
    expected = [state]
    for command in commands[:-1]:
        rates = lambda t, x, c=command: rov_rates(x, c)
        state = solve_ivp(rates, (0.0, 0.01), state, method="DOP853", rtol=1e-11, atol=1e-11).y[:, -1]
        expected.append(state)
    shown = (*VELOCITIES.values(), "phi", "theta", "psi", "z")
    found = np.stack([np.asarray(found)[:, names.index(name)] for name in shown], axis=1)
    expected = np.array(expected)[:, :10]
    assert np.abs(expected[:, :6]).max() > 0.3
    np.testing.assert_allclose(found, expected, atol=1e-6)
