"""REMUS 100 as its publication has it, flown by an autopilot: NumPy, and nothing of the package's model.

Prestero (2001), MIT thesis, about the centre of gravity, the small terms `Y_rr`, `Z_qq`, `M_ww` and `N_vv` left out.
Where copies of the coefficients disagree, quadratic damping is taken as -1310 in sway, -131 in heave, -188 in pitch and
-94 in yaw.
"""

import dataclasses

import numpy as np

INTERVAL, STEPS, SPEED = 0.2, 10, 1.54
STATES: tuple[str, ...] = ("u", "v", "w", "p", "q", "r", "phi", "theta", "psi", "z")
INPUTS: tuple[str, ...] = ("delta_r", "delta_s")
_WEIGHT, _BUOYANCY, _GRAVITY, _LEVER = 299.0, 306.0, 9.81, 0.0196
_MASS, _IX, _IY = _WEIGHT / _GRAVITY, 0.177, 3.45
# what a fin may turn, rad
_FIN = 0.3

# the slope of u² over the speeds that are flown, 1.0 to 1.6 m/s
_SLOPE = 2.67
# labels of the vocabulary with the numbers that the publication has for them, SI: of a hull's, less what
# `coriolis-coupling` does of it, such as the moment of Munk; of a fin's, by the slope
MISSING = {
    "speed-scaling[sway,sway]": -28.6, "speed-scaling[sway,yaw]": 5.22 + 0.93, "speed-scaling[heave,heave]": -28.6,
    "speed-scaling[heave,pitch]": -5.22 - 0.93, "speed-scaling[pitch,heave]": 24.0 - (35.5 - 0.93),
    "speed-scaling[pitch,pitch]": -2.0 - 1.93, "speed-scaling[yaw,sway]": -24.0 + (35.5 - 0.93),
    "speed-scaling[yaw,yaw]": -2.0 - 1.93,
    "speed-scaling[sway,rudder]": 9.64 * _SLOPE, "speed-scaling[heave,stern_plane]": -9.64 * _SLOPE,
    "speed-scaling[pitch,stern_plane]": -6.15 * _SLOPE, "speed-scaling[yaw,rudder]": -6.15 * _SLOPE,
    "quadratic-damping[sway]": -1310.0, "quadratic-damping[heave]": -131.0, "quadratic-damping[roll]": -0.13,
    "quadratic-damping[pitch]": -188.0, "quadratic-damping[yaw]": -94.0, "coriolis-coupling": 1.0,
}  # fmt: skip
# what says of two of them together much the same
ALIKE = ("crossflow-drag[horizontal]", "crossflow-drag[vertical]")

_INERTIA = np.diag([_MASS + 0.93, _MASS + 35.5, _MASS + 35.5, _IX + 0.0704, _IY + 4.88, _IY + 4.88])
_INERTIA[1, 5] = _INERTIA[5, 1] = -1.93
_INERTIA[2, 4] = _INERTIA[4, 2] = 1.93
_INVERSE = np.linalg.inv(_INERTIA)


def rates(x: np.ndarray, rudder: float, stern: float) -> np.ndarray:
    """The derivative of the state (10,) `STATES`."""
    u, v, w, p, q, r, phi, theta, _, _ = x
    light = _BUOYANCY - _WEIGHT
    m, s, c = _MASS, np.sin, np.cos
    force = np.array([
        light * s(theta) - 1.62 * (u * abs(u) - SPEED**2) - (35.5 + m) * w * q - 1.93 * q * q
        + (35.5 + m) * v * r - 1.93 * r * r,
        -light * c(theta) * s(phi) - 1310.0 * v * abs(v) - 28.6 * u * v + (5.22 - m) * u * r + (35.5 + m) * w * p
        + 1.93 * p * q + 9.64 * u * u * rudder,
        -light * c(theta) * c(phi) - 131.0 * w * abs(w) - 28.6 * u * w + (m - 5.22) * u * q - (35.5 + m) * v * p
        + 1.93 * r * p - 9.64 * u * u * stern,
        -_LEVER * _BUOYANCY * c(theta) * s(phi) - 0.13 * p * abs(p),
        -_LEVER * _BUOYANCY * s(theta) - 188.0 * q * abs(q) + 24.0 * u * w - 2.0 * u * q - 1.93 * v * p
        + (4.86 + _IY - _IX) * r * p - 6.15 * u * u * stern,
        -94.0 * r * abs(r) - 24.0 * u * v - 2.0 * u * r - 1.93 * w * p - (4.86 + _IY - _IX) * p * q
        - 6.15 * u * u * rudder,
    ])  # fmt: skip
    turn = q * s(phi) + r * c(phi)
    attitude = [p + turn * np.tan(theta), q * c(phi) - r * s(phi), turn / c(theta)]
    sinking = -u * s(theta) + v * c(theta) * s(phi) + w * c(theta) * c(phi)
    return np.concatenate([_INVERSE @ force, attitude, [sinking]])


@dataclasses.dataclass
class Autopilot:
    """Heading and depth by fins, towards set points that change now and then, with a little of a random shake."""

    rng: np.random.Generator
    heading: float
    depth: float

    def __post_init__(self) -> None:
        self.first, self.level = self.heading, self.depth
        self.turn_at, self.dive_at = self.rng.uniform(8.0, 15.0), self.rng.uniform(10.0, 20.0)
        self.shake = np.zeros(2)

    def fins(self, k: int, x: np.ndarray) -> tuple[float, float]:
        """Rudder and stern plane (rad) of sample `k` in state `x`."""
        t, draw = k * INTERVAL, self.rng.uniform
        if t > self.turn_at:
            self.heading, self.turn_at = self.first + draw(-1.5, 1.5), t + draw(10.0, 22.0)
        if t > self.dive_at:
            self.depth, self.dive_at = self.level + draw(-2.5, 2.5), t + draw(15.0, 30.0)
        if k % 10 == 0:
            self.shake = 0.05 * self.rng.choice([-1.0, 1.0], 2)
        pitch = np.clip(0.12 * (x[9] - self.depth), -0.3, 0.3)
        off = (self.heading - x[8] + np.pi) % (2.0 * np.pi) - np.pi
        wanted = np.array([0.8 * x[5] - off, 1.2 * (x[7] - pitch) + x[4]])
        rudder, stern = np.clip(np.clip(wanted, -0.8 * _FIN, 0.8 * _FIN) + self.shake, -_FIN, _FIN)
        return float(rudder), float(stern)


def fly(samples: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """States (K, 10) and fins (K, 2) of a run, held between samples, by Runge–Kutta steps."""
    x = np.zeros(len(STATES))
    x[0], x[8], x[9] = 1.5, rng.uniform(-3.0, 3.0), 10.0
    pilot, h = Autopilot(rng, x[8], x[9]), INTERVAL / STEPS
    states, fins = [], []
    for k in range(samples):
        held = pilot.fins(k, x)
        states.append(x)
        fins.append(held)
        for _ in range(STEPS):
            k1 = rates(x, *held)
            k2 = rates(x + h / 2 * k1, *held)
            k3 = rates(x + h / 2 * k2, *held)
            x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + rates(x + h * k3, *held))
    return np.array(states), np.array(fins)
