"""Pairs and a triple of effects that a weak record cannot tell apart, and the weak record of each."""

import dataclasses

import jax.numpy as jnp
import numpy as np

from experiments.concealed_physics.bodies import CRUISE_SHAFT, body, commands, start_state
from jaxsub.effects import VOCABULARY, AbstractEffect, with_numbers
from jaxsub.recording import Recording
from jaxsub.simulation import sampled_states, synthetic
from jaxsub.vehicle import AbstractVehicle

INTERVAL = 0.2
CASES = ("roll-moment", "lag-delay", "damping")


@dataclasses.dataclass(frozen=True)
class Case:
    """A vehicle, its rivals with sizes to start a fit from, the first of them the truth, and the weak record."""

    vehicle: AbstractVehicle
    rivals: list[AbstractEffect]
    start: np.ndarray
    record: Recording

    @property
    def truth(self) -> AbstractVehicle:
        """The vehicle with the effect that it has."""
        return self.vehicle.with_effect(self.rivals[0])

    def driven(self, recording: Recording, seed: int, noise: bool = True) -> Recording:
        """What the truth records when driven by the inputs of `recording`."""
        start = np.append(self.start, np.zeros(len(self.truth.layout.positions) - len(self.vehicle.layout.positions)))
        options = {"start": jnp.asarray(start[None]), "states": sampled_states}
        (answer,) = synthetic(self.truth, [recording], seed=seed, noise=noise, **options)
        return answer


def case(name: str, seconds: float) -> Case:
    """One of `CASES`, its record of a length in s."""
    samples = round(seconds / INTERVAL) + 1
    t, rng = INTERVAL * np.arange(samples), np.random.default_rng(5)
    if name == "roll-moment":
        # nothing but the shaft speed tells a propeller's torque from the others, and it stays where it is
        vehicle = body("nps")
        inputs = commands("nps", 0, samples, rng) * [1.0, 0.7, 0.7, 0.0] + [0.0, 0.0, 0.0, CRUISE_SHAFT]
        moment = 12.0
        rivals = [
            effect("propeller-torque", {"torque": moment / CRUISE_SHAFT**2}, grows_with="shaft_speed"),
            effect("trim-offset", {"offset": -moment / 53400.0}, axis="y"),
            effect("hull-asymmetry", {"constant": moment}, equation="roll"),
        ]
        return _made(vehicle, rivals, start_state("nps", vehicle, rng), t, inputs)
    if name == "lag-delay":
        # a slow sine is late by as much, whether by a lag or by a delay
        vehicle = body("rig")
        rivals = [effect(n, {s: 0.1}, actuator="drive") for n, s in (("actuator-lag", "T"), ("actuator-delay", "tau"))]
        return _made(vehicle, rivals, np.zeros(2), t, 0.8 * np.sin(0.5 * t)[:, None])
    # one amplitude and one frequency: any drag is like a linear one there
    vehicle = body("rig")
    rivals = [
        effect(n, {"coefficient": c}, equation="x") for n, c in (("quadratic-damping", -0.5), ("cubic-damping", -1.0))
    ]
    return _made(vehicle, rivals, np.zeros(2), t, 0.4 * np.sin(1.6 * t)[:, None])


def effect(name: str, numbers: dict[str, float], **options: str) -> AbstractEffect:
    """An effect of the vocabulary."""
    chosen = next(kind for kind in VOCABULARY if kind.name == name)
    return with_numbers(chosen(**options), numbers)


def _made(
    vehicle: AbstractVehicle, rivals: list[AbstractEffect], start: np.ndarray, times: np.ndarray, inputs: np.ndarray
) -> Case:
    columns = dict(zip(vehicle.layout.held, inputs.T, strict=True))
    blank = Recording("recorded", times, columns, "recorded")
    made = Case(vehicle, rivals, start, blank)
    return dataclasses.replace(made, record=made.driven(blank, 0))
