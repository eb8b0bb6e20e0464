"""Facts, motions and candidates on which every effect of the vocabulary is tried."""

import jax.numpy as jnp
import numpy as np

from jaxsub.effects import (
    EQUATIONS,
    AbstractActuation,
    Facts,
    Motion,
    amplitudes,
    candidates,
    number_fields,
    with_numbers,
)

CHANNELS = ("u", "r", "theta", "z", "ax", "depth_rate")


class Quadratic(AbstractActuation):
    """Each actuator pushes in sway by the square of its command."""

    def force_of(self, name, motion):
        return {"sway": 3.0 * abs(motion.actuators[name]) * motion.actuators[name]}


def facts(kind="submerged-body", equations=EQUATIONS, actuators=("rudder", "elevator", "shaft_speed")):
    rates, places = dict.fromkeys(equations, 0.3), dict.fromkeys(equations, 1.5)
    channels = CHANNELS if kind == "submerged-body" else tuple(equations)
    inputs, outputs = dict.fromkeys(actuators, (0.2, 0.4, 2.0)), dict.fromkeys(channels, (-0.001, 1.2))
    return Facts(
        kind, tuple(equations), tuple(actuators), channels, ("temperature", "altitude"), 2.0, 0.2, rates, 0.1,
        60.0, {} if kind == "submerged-body" else places, inputs, outputs, (0.3, 4.0),
        dict.fromkeys(equations, (0.9, 2.1)), 150, fixed_gains=tuple(actuators),
        speed=1.2 if kind == "submerged-body" else 0.0,
    )  # fmt: skip


BODY, RIG = facts(), facts("mechanism", ("x", "roll", "yaw", "sway"), ("motor",))


def motion(known, count=40, cruise=1.2, seed=1):
    """Random motion of the vehicle that `known` describes: (count,) along every leaf."""
    rng = np.random.default_rng(seed)
    draw = lambda names: {name: jnp.asarray(rng.normal(size=count)) for name in names}
    body = known.kind == "submerged-body"
    equations = EQUATIONS if body else known.equations
    rates, positions = draw(equations), draw(("phi", "theta", "psi", "x", "y", "z") if body else known.equations)
    root = rng.normal(size=(len(rates), len(rates)))
    inertia = jnp.asarray(root @ root.T + np.eye(len(rates)))
    surroundings = {"temperature": jnp.asarray(rng.normal(285.0, 3.0, count)), "altitude": abs(draw(["a"])["a"])}
    actuators, memories = draw(known.actuators), [f"{kind}_{e}" for e in equations for kind in ("memory", "hysteresis")]
    return Motion(
        rates, positions | draw(memories), actuators, surroundings, inertia, 500.0 if body else 0.0,
        cruise if body else 0.0, jnp.linspace(0.0, 60.0, count), draw(known.equations),
        actuation=Quadratic(),
    )  # fmt: skip


def still(now):
    """The same with every velocity, position, deflection and acceleration at zero."""
    zero = lambda named: {name: 0.0 * value for name, value in named.items()}
    return Motion(
        zero(now.rates), zero(now.positions), zero(now.actuators), now.environment, now.inertia, now.buoyancy, 0.0,
        now.time, zero(now.accelerations), actuation=now.actuation,
    )  # fmt: skip


def all_candidates():
    """(facts, effect) for every candidate on the body and on the rig."""
    return [(known, effect) for known in (BODY, RIG) for effect in candidates(known)]


def one_of_each():
    """(facts, effect): of candidates that differ in their shape or in the equation alone, the first."""
    found = {}
    for known, effect in all_candidates():
        found.setdefault((known.kind, type(effect)), (known, effect))
    return list(found.values())


def name(pair):
    """A short name of a (facts, effect) pair, for the report of tests."""
    known, effect = pair
    shapes = [f"{float(getattr(effect, f.name)):g}" for f in number_fields(effect) if f.metadata["role"] == "shape"]
    return "-".join([known.kind, effect.label, *shapes])


def sized(effect, sizes):
    """The effect with its amplitudes replaced by `sizes`."""
    return with_numbers(effect, dict(zip(amplitudes(effect), map(jnp.asarray, sizes), strict=True)))
