"""Models of a user's own: the motor, the tank and the double pendulum of the guide."""

from typing import ClassVar

import jax.numpy as jnp

from jaxsub.vehicle import Model


class Motor(Model):
    """A brushed motor: its current (A) and its speed (rad/s)."""

    states, inputs, outputs = ("current", "speed"), ("voltage",), {"current": 0.02, "speed": 0.2}
    R: float
    L: float
    k: float
    J: float

    def rates(self, state, inputs, time):
        """Of the current (A/s) and of the speed (rad/s²)."""
        current, speed = state["current"], state["speed"]
        return {
            "current": (inputs["voltage"] - self.R * current - self.k * speed) / self.L,
            "speed": self.k * current / self.J,
        }


class Tank(Model):
    """A tank that empties through a hole in its bottom, by Torricelli."""

    states, inputs, outputs = ("level",), ("pump",), {"level": 0.002}
    parameters: ClassVar = {"area": {"fixed": True}}
    area: float
    hole: float

    def rates(self, state, inputs, time):
        """Of the level, m/s."""
        out = self.hole * jnp.sqrt(2.0 * 9.81 * jnp.maximum(state["level"], 1e-6))
        return {"level": (inputs["pump"] - out) / self.area}


class DoublePendulum(Model):
    """Two equal rods without mass, a bob at the end of each, and a motor at the hinge."""

    states, inputs, outputs = ("one", "two", "one_rate", "two_rate"), ("torque",), {"one": 0.01, "two": 0.01}
    m: float
    b: float
    length: float = 0.4

    def rates(self, state, inputs, time):
        """Of the angles (rad/s) and of their rates (rad/s²)."""
        a, b, p, q = (state[name] for name in self.states)
        m, L, g, c, s = self.m, self.length, 9.81, jnp.cos(a - b), jnp.sin(a - b)
        one = inputs["torque"] - m * L**2 * s * q**2 - 2.0 * m * g * L * jnp.sin(a) - self.b * p
        two = m * L**2 * s * p**2 - m * g * L * jnp.sin(b) - self.b * q
        scale = m * L**2 * (2.0 - c**2)
        return {"one": p, "two": q, "one_rate": (one - c * two) / scale, "two_rate": (2.0 * two - c * one) / scale}
