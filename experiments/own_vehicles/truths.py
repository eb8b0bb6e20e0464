"""What is concealed in the trials, in the generator's own words."""

import dataclasses
import math

import jax.numpy as jnp
import numpy as np

from experiments.concealed_physics.actuators import lag
from experiments.concealed_physics.sensors import late
from experiments.concealed_physics.surroundings import over_ground, tether
from experiments.concealed_physics.truth import Truth
from jaxsub.parameters import Parameter
from jaxsub.vehicle import AbstractVehicle, SubmergedBody

_NAMES = ("surge", "sway", "heave", "roll", "pitch", "yaw")


def actuator(name: str, actuator: str, **does) -> Truth:
    return Truth(name, actuator, "actuators", (f"input:{actuator}",), math.inf, actuator=actuator, **does)


def sensor(name: str, channels: tuple[str, ...], sense) -> Truth:
    places = tuple(f"sensor:{channel}" for channel in channels)
    return Truth(name, ",".join(channels), "sensors", places, math.inf, sense=sense)


def slow(name: str) -> Truth:
    """An actuator that lags by a time constant, s."""
    return actuator("actuator-lag", name, command=lag)


def delayed(channel: str) -> Truth:
    """A channel that is shown late, by s."""
    return sensor("sensor-delay", (channel,), lambda a, t, c: {channel: late(a, t, c[channel])})


def off(motion: str) -> Truth:
    """A sensor of a prescribed motion that is off: what it shows is the case's `recorded`."""
    return Truth("sensor-bias", motion, "sensors", (f"sensor:{motion}",), math.inf)


def turned() -> Truth:
    """A DVL that is turned about the vertical, by rad."""
    shown = lambda a, t, c: {
        "u": c["u"] * jnp.cos(a) + c["v"] * jnp.sin(a),
        "v": c["v"] * jnp.cos(a) - c["u"] * jnp.sin(a),
    }
    return sensor("sensor-misalignment", ("u", "v"), shown)


def towed() -> Truth:
    """A line from the surface, whose drag is that of its length, N s²/m² a metre."""
    where = ("surge", "sway", "heave")
    return Truth("tether-drag", "to the surface", "environment", where, math.inf, force=tether)


def dry(equation: str) -> Truth:
    """Friction that has the same size at every speed, over the inertia."""
    force = lambda a, m: {equation: -a * jnp.tanh(m.rates[equation] / 0.05)}
    return Truth("coulomb-friction", equation, "mechanisms", (equation,), math.inf, force=force)


def drifting(number: str) -> Truth:
    """A number that is another in each run."""
    return Truth("run-variation", number, "environment", ("surge", "heave"), math.inf)


def weak_t200(a, m):
    """A T200 at (0.156, -0.111, 0.085) m, 45° to starboard, that makes 1 - a of its thrust."""
    c = m.actuators["t2"]
    thrust = 8.9 * c + 176.0 * c**3 - 404.1 * c**5 + 389.9 * c**7 - 140.3 * c**9
    force = -a * thrust * jnp.array([1.0, 1.0, 0.0]) / math.sqrt(2.0)
    moment = jnp.cross(jnp.array([0.156, -0.111, 0.085]), force)
    return dict(zip(_NAMES, [*force, *moment], strict=True))


def weak_shaft(a, m):
    """Otter's starboard propeller, 0.395 m off the centre line, ahead."""
    n = m.actuators["right"]
    lost = a * jnp.where(n > 0.0, 0.01108, 0.006445) * abs(n) * n
    return {"surge": -lost, "yaw": 0.395 * lost}


def stream(ship: AbstractVehicle) -> Truth:
    """A steady stream to the north-east: forces follow the velocity through it, and it turns in the ship's axes."""
    inertia = np.asarray(ship.mass_matrix())

    def force(a, m):
        north, east = over_ground(m)
        flow = a * (0.8 * north + 0.6 * east)
        through = m.rates | {e: m.rates[e] - flow[i] for i, e in enumerate(("surge", "sway"))}
        more = ship.force(dataclasses.replace(m.motion, rates=through)) - ship.force(m.motion)
        moving, turning = jnp.stack([flow[0], flow[1], 0.0 * a]), jnp.stack([flow[1], -flow[0], 0.0 * a])
        more = more - m.damping @ moving + m.rates["yaw"] * inertia @ turning
        return dict(zip(ship.layout.equations, more, strict=True))

    return Truth("current", "steady", "environment", ship.layout.equations, math.inf, force=force)


def out_of_the_race(ship: SubmergedBody) -> SubmergedBody:
    """KVLCC2 with a rudder in the ship's own speed, how strong it is left to the fit."""
    rudder = next(item for item in ship.actuators.items if item.name == "rudder")
    numbers = rudder.numbers | {"gain": jnp.asarray(0.7)}
    items = tuple(
        dataclasses.replace(item, propeller="", numbers=numbers) if item is rudder else item
        for item in ship.actuators.items
    )
    actuators = dataclasses.replace(ship.actuators, items=items)
    row = Parameter("rudder.gain", "1", prior_mean=0.7)
    layout = dataclasses.replace(ship.layout, parameters=(*ship.layout.parameters, row))
    return dataclasses.replace(ship, actuators=actuators, layout=layout)
