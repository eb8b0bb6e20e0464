"""Which cases there are: a vehicle, and the one effect that its file leaves out, in the generator's own words."""

import dataclasses
import math
from collections.abc import Callable, Mapping
from typing import Any

import jax.numpy as jnp
import numpy as np

from experiments.concealed_physics.actuators import lag
from experiments.concealed_physics.sensors import late
from experiments.concealed_physics.surroundings import over_ground, tether
from experiments.concealed_physics.truth import Truth
from jaxsub.parameters import Parameter
from jaxsub.vehicle import AbstractVehicle, SubmergedBody
from jaxsub.vehicle.catalogue import kvlcc2


@dataclasses.dataclass(frozen=True)
class Case:
    """A vehicle and what is concealed in its recordings.

    **Fields**

    - `name`: in the results, and the folder of its files. `vehicle`: by key of `TRIALS`. `concealed`: in words.
    - `truth`: the effect and its size; none where a number is what differs, or nothing.
    - `factors`: by which numbers of the true vehicle differ from the catalogue's, which the file has and leaves free.
    - `file(vehicle)`: what the owner's file has of the vehicle, where that is not all.
    """

    name: str
    vehicle: str
    concealed: str
    truth: tuple[Truth, float] | None = None
    factors: Mapping[str, float] = dataclasses.field(default_factory=dict)
    file: Callable[[Any], AbstractVehicle] = lambda vehicle: vehicle


_NAMES = ("surge", "sway", "heave", "roll", "pitch", "yaw")


def _actuator(name: str, actuator: str, **does) -> Truth:
    return Truth(name, actuator, "actuators", (f"input:{actuator}",), math.inf, actuator=actuator, **does)


def _sensor(name: str, channels: tuple[str, ...], sense) -> Truth:
    places = tuple(f"sensor:{channel}" for channel in channels)
    return Truth(name, ",".join(channels), "sensors", places, math.inf, sense=sense)


def _weak_t200(a, m):
    """A T200 at (0.156, -0.111, 0.085) m, 45° to starboard, that makes 1 - a of its thrust."""
    c = m.actuators["t2"]
    thrust = 8.9 * c + 176.0 * c**3 - 404.1 * c**5 + 389.9 * c**7 - 140.3 * c**9
    force = -a * thrust * jnp.array([1.0, 1.0, 0.0]) / math.sqrt(2.0)
    moment = jnp.cross(jnp.array([0.156, -0.111, 0.085]), force)
    return dict(zip(_NAMES, [*force, *moment], strict=True))


def _weak_shaft(a, m):
    """Otter's starboard propeller, 0.395 m off the centre line, ahead."""
    n = m.actuators["right"]
    lost = a * jnp.where(n > 0.0, 0.01108, 0.006445) * abs(n) * n
    return {"surge": -lost, "yaw": 0.395 * lost}


def _stream(ship: AbstractVehicle) -> Truth:
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


def _out_of_the_race(ship: SubmergedBody) -> SubmergedBody:
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


CASES = (
    Case("rov-weak-thruster", "BlueROV2 Heavy", "thruster t2 20 % weak",
         (_actuator("actuator-gain", "t2", force=_weak_t200), 0.2)),
    Case("otter-weak-thruster", "Otter", "starboard propeller 20 % weak",
         (_actuator("actuator-gain", "right", force=_weak_shaft), 0.2)),
    Case("otter-lag", "Otter", "port propeller lags by 1 s", (_actuator("actuator-lag", "left", command=lag), 1.0)),
    Case("ship-compass-delay", "KVLCC2", "compass 1.5 s late",
         (_sensor("sensor-delay", ("psi",), lambda a, t, c: {"psi": late(a, t, c["psi"])}), 1.5)),
    Case("otter-none", "Otter", "nothing"),
    Case("ship-current", "KVLCC2", "current of 0.1 m/s", (_stream(kvlcc2()), 0.1)),
    Case("otter-drag", "Otter", "biofouled: surge drag 40 % more", factors={"X_u": 1.4}),
    Case("auv-dvl-turned", "NPS AUV II", "DVL turned by 2°",
         (_sensor("sensor-misalignment", ("u", "v"), lambda a, t, c: {
             "u": c["u"] * jnp.cos(a) + c["v"] * jnp.sin(a), "v": c["v"] * jnp.cos(a) - c["u"] * jnp.sin(a)}),
          math.radians(2.0))),
    Case("ship-race", "KVLCC2", "rudder in the propeller's race",
         (Truth("propeller-race", "rudder", "actuators", ("sway", "yaw"), math.inf), 1.0), file=_out_of_the_race),
    Case("ship-none", "KVLCC2", "nothing"),
    Case("rov-tether", "BlueROV2 Heavy", "tether of 7.6 mm",
         (Truth("tether-drag", "to the surface", "environment", ("surge", "sway", "heave"), math.inf, force=tether),
          4.6)),
    Case("rov-lag", "BlueROV2 Heavy", "thruster t5 lags by 0.5 s",
         (_actuator("actuator-lag", "t5", command=lag), 0.5)),
    Case("rov-added-mass", "BlueROV2 Heavy", "added mass in heave 30 % less", factors={"Z_wdot": 0.7}),
    Case("rov-none", "BlueROV2 Heavy", "nothing"),
    Case("remus-drag", "REMUS 100", "biofouled: surge drag 40 % more", factors={"X_u|u|": 1.4}),
)  # fmt: skip
# the first of the list, one vehicle after the other
QUICK = 5
