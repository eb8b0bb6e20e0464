"""Which cases there are: a vehicle, and the one effect that its file leaves out, in the generator's own words."""

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from experiments.concealed_physics.truth import Truth
from experiments.concealed_physics.truths import TRUTHS
from jaxsub.vehicle import AbstractVehicle
from jaxsub.vehicle.catalogue import kvlcc2

from .truths import (
    actuator,
    delayed,
    drifting,
    dry,
    off,
    out_of_the_race,
    slow,
    stream,
    towed,
    turned,
    weak_shaft,
    weak_t200,
)


@dataclasses.dataclass(frozen=True)
class Case:
    """A vehicle and what is concealed in its recordings.

    **Fields**

    - `name`: in the results, and the folder of its files. `vehicle`: by key of `TRIALS`. `concealed`: in words.
    - `truth`: the effect and its size; none where a number is what differs, or nothing.
    - `factors`: by which numbers of the true vehicle differ from the catalogue's, which the file has and leaves free.
    - `drifts`: what is added to such a number in each run, SI.
    - `recorded(prescribed)`: what sensors make of the motions that the file prescribes, (…, c), SI.
    - `file(vehicle)`: what the owner's file has of the vehicle, where that is not all.
    """

    name: str
    vehicle: str
    concealed: str
    truth: tuple[Truth, float] | None = None
    factors: Mapping[str, float] = dataclasses.field(default_factory=dict)
    drifts: Mapping[str, Sequence[float]] = dataclasses.field(default_factory=dict)
    file: Callable[[Any], AbstractVehicle] = lambda vehicle: vehicle
    recorded: Callable[[np.ndarray], np.ndarray] = lambda prescribed: prescribed


CASES = (
    Case("rov-weak-thruster", "BlueROV2 Heavy", "thruster t2 20 % weak",
         (actuator("actuator-gain", "t2", force=weak_t200), 0.2)),
    Case("otter-weak-thruster", "Otter", "starboard propeller 20 % weak",
         (actuator("actuator-gain", "right", force=weak_shaft), 0.2)),
    Case("otter-lag", "Otter", "port propeller lags by 1 s", (slow("left"), 1.0)),
    Case("ship-compass-delay", "KVLCC2", "compass 1.5 s late", (delayed("psi"), 1.5)),
    Case("otter-none", "Otter", "nothing"),
    Case("ship-current", "KVLCC2", "current of 0.1 m/s", (stream(kvlcc2()), 0.1)),
    Case("otter-drag", "Otter", "biofouled: surge drag 40 % more", factors={"X_u": 1.4}),
    Case("auv-dvl-turned", "NPS AUV II", "DVL turned by 2°", (turned(), math.radians(2.0))),
    Case("ship-race", "KVLCC2", "rudder in the propeller's race",
         (Truth("propeller-race", "rudder", "actuators", ("sway", "yaw"), math.inf), 1.0), file=out_of_the_race),
    Case("ship-none", "KVLCC2", "nothing"),
    Case("rov-tether", "BlueROV2 Heavy", "tether of 7.6 mm", (towed(), 4.6)),
    Case("rov-lag", "BlueROV2 Heavy", "thruster t5 lags by 0.5 s", (slow("t5"), 0.5)),
    Case("rov-added-mass", "BlueROV2 Heavy", "added mass in heave 30 % less", factors={"Z_wdot": 0.7}),
    Case("rov-none", "BlueROV2 Heavy", "nothing"),
    Case("remus-drag", "REMUS 100", "biofouled: surge drag 40 % more", factors={"X_u|u|": 1.4}),
    Case("suboff-lag", "SUBOFF", "stern plane lags by 0.4 s", (slow("stern_plane"), 0.4)),
    Case("torpedo-compass-delay", "Torpedo", "compass 0.6 s late", (delayed("psi"), 0.6)),
    Case("rexrov-tether", "RexROV", "tether of 30 mm", (towed(), 18.504)),
    Case("seaglider-drift", "Seaglider", "buoyancy falls from dive to dive, by 0.3 N in all",
         (drifting("buoyancy"), 0.1), drifts={"buoyancy": (0.0, -0.05, -0.12, -0.15, -0.22, -0.3)}),
    Case("slocum-shrinks", "Slocum", "hull shrinks under pressure", (TRUTHS["nps/hull-compressibility[depth]"], 1e-9)),
    Case("motor-friction", "Motor", "dry friction", (dry("speed"), 10.0)),
    Case("tank-lag", "Tank", "pump lags by 30 s", (slow("pump"), 30.0)),
    Case("pendulum-delay", "Double pendulum", "encoder of the lower rod 0.05 s late", (delayed("two"), 0.05)),
    Case("seaglider-pitch", "Seaglider", "pitch sensor 1° off", (off("theta"), math.radians(1.0)),
         recorded=lambda moved: moved + np.array([math.radians(1.0), 0.0])),
    Case("torpedo-none", "Torpedo", "nothing"),
    Case("seaglider-none", "Seaglider", "nothing"),
    Case("motor-none", "Motor", "nothing"),
    Case("pendulum-none", "Double pendulum", "nothing"),
)  # fmt: skip
# the first of the list, one vehicle after the other
QUICK = 5
