"""Grades of inertial sensors, in round numbers of their data sheets.

Source: Groves (2013), Principles of GNSS, inertial and multisensor integrated navigation systems, §4.4.
"""

import math
from typing import NamedTuple

from ...effects import GRAVITY

_DEGREE, _MILLI_G = math.radians(1.0), 1e-3 * GRAVITY
# s for which a motion goes one way: errors that grow with it are white over longer times
_STROKE = 0.5


class Grade(NamedTuple):
    """Errors of a triad of inertial sensors, SI.

    **Fields**

    - `density`: white noise, rad/s/√Hz or m/s²/√Hz. `bias`: standard deviation at switch-on, rad/s or m/s².
    - `wander`: random walk of the bias, its unit a root second. `scale_error`: standard deviation of each axis's scale,
      and of its misalignment towards each other axis in rad. `nonlinearity`: share of a reading that neither explains.
    """

    density: float
    bias: float
    wander: float
    scale_error: float
    nonlinearity: float


def motion_density(share: float) -> float:
    """√s: density of the noise that an unknown share of the reading makes of a motion of size one, to and fro."""
    return share * math.sqrt(2.0 * _STROKE)


GRADES: dict[str, dict[str, Grade]] = {
    "gyro": {
        "consumer": Grade(0.01 * _DEGREE, 1.0 * _DEGREE, 1e-5, 5e-3, 1e-3),
        "industrial": Grade(0.005 * _DEGREE, 0.2 * _DEGREE, 2e-6, 1e-3, 3e-4),
        "tactical": Grade(0.002 * _DEGREE, 10.0 * _DEGREE / 3600.0, 1e-7, 3e-4, 1e-4),
    },
    "accelerometer": {
        "consumer": Grade(1e-2, 10.0 * _MILLI_G, 1e-4, 5e-3, 1e-3),
        "industrial": Grade(1e-3, 3.0 * _MILLI_G, 1e-5, 1e-3, 3e-4),
        "tactical": Grade(5e-4, 1.0 * _MILLI_G, 2e-6, 3e-4, 1e-4),
    },
}
