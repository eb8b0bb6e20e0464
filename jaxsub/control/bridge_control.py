"""A plant in python-control: the plant itself as a nonlinear system, its linear form as a state space."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from ..errors import InputError
from .linear import LinearPlant
from .plant import Plant


def control_system(plant: Plant, name: str | None = None) -> Any:
    """The discrete-time `control.NonlinearIOSystem` of `plant`; states, inputs and outputs have its names, SI.

    python-control calls the compiled step and outputs of the plant at the times of samples, so the two agree exactly.

    **Raises** `InputError` where python-control is not installed.
    """
    control = _control()
    step, output = (eqx.filter_jit(function) for function in (plant.step, plant.output))

    def called(function: Any) -> Any:
        def at(t: float | int, x: np.ndarray, u: np.ndarray, params: dict) -> np.ndarray:
            return np.asarray(function(*(jnp.asarray(part, plant.constants.dtype) for part in (x, u, t))))

        return at

    names = {"states": list(plant.states), "inputs": list(plant.inputs), "outputs": list(plant.outputs)}
    system_name = _plain(name or plant.vehicle.layout.name)
    return control.NonlinearIOSystem(called(step), called(output), dt=plant.dt, name=system_name, **names)


def state_space(linear: LinearPlant, name: str | None = None) -> Any:
    """The `control.StateSpace` of deviations from the point of `linear`; continuous where its `dt` is zero.

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
