"""Concealed actuator effects: what becomes of a command before it moves water.

Commands come at steps of h s, far finer than the recording, each constant over its step.
"""

import jax
import jax.numpy as jnp

from .bodies import LARGEST_RUDDER
from .truth import Truth

_DRIVES = {
    "rudder": ("sway", "yaw"), "elevator_right": ("heave", "pitch", "roll"), "stern_plane": ("heave", "pitch"),
    "drive": ("x",),
}  # fmt: skip


def lag(a, h, held):
    """The mean deflection over each step of T δ' = command - δ, exact for a constant command."""
    fade = jnp.exp(-h / a)

    def step(delta, command):
        after = command + (delta - command) * fade
        return after, command + (delta - command) * (1.0 - fade) * a / h

    return jax.lax.scan(step, held[0], held)[1]


def _delay(a, h, held):
    """The mean of the late command over each step."""
    edges = h * jnp.arange(len(held) + 1)
    impulse = jnp.concatenate([jnp.zeros(1), jnp.cumsum(held) * h])
    late = edges - a
    shifted = jnp.where(late < 0.0, held[0] * late, jnp.interp(late, edges, impulse))
    return jnp.diff(shifted) / h


def _rate_limit(a, h, held):
    """At most 1/a rad/s, so that a larger size is a slower servo."""

    def step(delta, command):
        after = delta + jnp.clip(command - delta, -h / a, h / a)
        return after, 0.5 * (delta + after)

    return jax.lax.scan(step, held[0], held)[1]


def _stop(a):
    """Of the rudder, rad: a grows from zero, where no command is cut."""
    return 1.0 / (a + 1.0 / LARGEST_RUDDER)


def _saturation(a, h, held):
    return jnp.clip(held, -_stop(a), _stop(a))


def _deadband(a, h, held):
    return jnp.where(held > a, held - a, jnp.where(held < -a, held + a, 0.0))


def _backlash(a, h, held):
    def step(delta, command):
        after = jnp.where(command - delta > a, command - a, jnp.where(delta - command > a, command + a, delta))
        return after, after

    return jax.lax.scan(step, held[0], held)[1]


def _on(actuator: str, name: str, command, limit: float, numbers=lambda a: {}, vehicle: str = "nps") -> Truth:
    return Truth(
        name, actuator, "actuators", (f"input:{actuator}",), limit, vehicle, actuator=actuator, command=command,
        numbers=numbers, lenient=_DRIVES[actuator],
    )  # fmt: skip


def _race(a, m):
    """Rudder force in the propeller's race, in excess of that at the mean shaft speed of 60 rad/s."""
    extra = a * m.actuators["rudder"] * (abs(m.actuators["shaft_speed"]) * m.actuators["shaft_speed"] / 3600.0 - 1.0)
    return {"sway": extra, "yaw": -2.5 * extra}


ACTUATORS = (
    _on("rudder", "actuator-lag", lag, 10.0, lambda a: {"T": a}),
    _on("elevator_right", "actuator-lag", lag, 10.0, lambda a: {"T": a}),
    _on("rudder", "actuator-delay", _delay, 5.0, lambda a: {"tau": a}),
    _on("rudder", "actuator-rate-limit", _rate_limit, 200.0, lambda a: {"R": 1.0 / a}),
    _on("rudder", "actuator-saturation", _saturation, 30.0, lambda a: {"limit": _stop(a)}),
    _on("rudder", "actuator-deadband", _deadband, 0.2, lambda a: {"d": a}),
    _on("rudder", "actuator-backlash", _backlash, 0.2),
    _on("rudder", "actuator-misalignment", lambda a, h, held: held + a, 0.3, lambda a: {"b": a}),
    _on("elevator_right", "actuator-misalignment", lambda a, h, held: held + a, 0.3, lambda a: {"b": a}),
    _on("rudder", "control-surface-stall", lambda a, h, held: held * (1.0 - a * held**2), 8.0, lambda a: {"k": a}),
    _on("stern_plane", "actuator-lag", lag, 10.0, lambda a: {"T": a}, vehicle="dsrv"),
    _on("drive", "actuator-delay", _delay, 2.0, lambda a: {"tau": a}, vehicle="rig"),
    Truth("propeller-race", "rudder", "actuators", ("sway", "yaw"), 3e3, force=_race, lenient=("input:rudder",)),
)
