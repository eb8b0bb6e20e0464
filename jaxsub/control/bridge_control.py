"""A plant in python-control: the plant itself as a nonlinear system, its linear form as a state space."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import numpy as np

from ..errors import InputError
from .linear import LinearPlant
from .plant import Plant


def control_system(plant: Plant, name: str | None = None) -> Any:
    """The discrete-time `control.NonlinearIOSystem` of `plant`, under `name`; its signals have the plant's names, SI.

    python-control calls the compiled step and outputs of the plant at the times of samples, so the two agree exactly.

    **Raises** `InputError` where python-control is not installed.
    """
    control = _control()
    # taken apart once: to do so at each call takes longer than the step
    numbers, rest = eqx.partition(plant, eqx.is_array)

    def called(method: Callable) -> Callable:
        run = jax.jit(lambda numbers, *arguments: method(eqx.combine(numbers, rest), *arguments))

        def at(t: float | int, x: np.ndarray, u: np.ndarray, params: dict) -> np.ndarray:
            return np.asarray(run(numbers, *(np.asarray(part, plant.constants.dtype) for part in (x, u, t))))

        return at

    names = {"states": list(plant.states), "inputs": list(plant.inputs), "outputs": list(plant.outputs)}
    system_name = _plain(name or plant.vehicle.layout.name)
    return control.NonlinearIOSystem(called(Plant.step), called(Plant.output), dt=plant.dt, name=system_name, **names)


def state_space(linear: LinearPlant, name: str | None = None) -> Any:
    """The `control.StateSpace`, named `name`, of deviations from the point of `linear`; continuous where `dt` is zero.

    It is exact for the linear plant; how far that is from the plant itself `linearisation_error` says.

    **Raises** `InputError` where python-control is not installed.
    """
    control = _control()
    matrices = [np.asarray(part) for part in (linear.A, linear.B, linear.C, linear.D)]
    names = {"states": list(linear.states), "inputs": list(linear.inputs), "outputs": list(linear.outputs)}
    return control.StateSpace(*matrices, linear.dt, name=_plain(name or "linear plant"), **names)


def _control() -> Any:
    try:
        import control
    except ImportError as error:
        raise InputError("python-control", "is not installed", "pip install 'jaxsub[control]'") from error
    return control


def _plain(name: str) -> str:
    """A name that python-control takes: dots part a system's name from a signal's."""
    return name.replace(".", "_").replace(" ", "_")
