"""Facts, motions and candidates on which every effect of the vocabulary is tried."""

import jax.numpy as jnp
import numpy as np

from jaxsub.effects import EQUATIONS, Facts, Motion, amplitudes, candidates, number_fields, with_numbers

CHANNELS = ("u", "r", "theta", "z", "ax", "depth_rate")


def facts(kind="submerged-body", equations=EQUATIONS, actuators=("rudder", "elevator", "shaft_speed")):
    rates = dict.fromkeys(equations, 0.3)
    channels = CHANNELS if kind == "submerged-body" else tuple(equations)
    return Facts(kind, tuple(equations), tuple(actuators), channels, ("temperature",), 2.0, 0.2, rates, 0.1)


BODY, RIG = facts(), facts("mechanism", ("x", "roll", "yaw", "sway"), ("motor",))


def motion(known, count=40, cruise=1.2, seed=1):
    """Random motion of the vehicle that `known` describes: (count,) along every leaf."""
    rng = np.random.default_rng(seed)
    draw = lambda names: {name: jnp.asarray(rng.normal(size=count)) for name in names}
    body = known.kind == "submerged-body"
    rates = draw(EQUATIONS if body else known.equations)
    positions = draw(("phi", "theta", "psi", "x", "y", "z") if body else known.equations)
    root = rng.normal(size=(len(rates), len(rates)))
    inertia = jnp.asarray(root @ root.T + np.eye(len(rates)))
    surroundings = {"temperature": jnp.asarray(rng.normal(285.0, 3.0, count))}
    buoyancy = 500.0 if body else 0.0
    return Motion(rates, positions, draw(known.actuators), surroundings, inertia, buoyancy, cruise if body else 0.0)


def all_candidates():
    """(facts, effect) for every candidate on the body and on the rig."""
    return [(known, effect) for known in (BODY, RIG) for effect in candidates(known)]


def name(pair):
    """A short name of a (facts, effect) pair, for the report of tests."""
    known, effect = pair
    shapes = [f"{float(getattr(effect, f.name)):g}" for f in number_fields(effect) if f.metadata["role"] == "shape"]
    return "-".join([known.kind, effect.label, *shapes])


def sized(effect, sizes):
    """The effect with its amplitudes replaced by `sizes`."""
    return with_numbers(effect, dict(zip(amplitudes(effect), map(jnp.asarray, sizes), strict=True)))
