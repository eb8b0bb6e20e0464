"""What became of an estimation: optimistix's results and the failures of this field."""

from typing import cast

import numpy as np
import optimistix as optx


# an equinox Enumeration, which may be subclassed, but for pyright it is an `enum.Enum`
class RESULTS(optx.RESULTS):  # pyright: ignore[reportGeneralTypeIssues]
    """Outcomes of a fit. Failures are values, so that they can be masked and counted under `vmap`."""

    nan_start = "The model does not run from these starting values: a residual is not finite there."
    indefinite_inertia = "The fitted inertia matrix is not positive definite."
    not_stationary = "The search stopped where the gradient is not small: more steps or another start are needed."


# to a checker of types a member is not of its enumeration. `promote` would run a program, which starts a backend of JAX
# when this file is imported, before a command has said how it is to compile
SUCCESSFUL = cast(RESULTS, RESULTS.successful)
NONFINITE = cast(RESULTS, RESULTS.nonfinite)
UNFINISHED = cast(RESULTS, RESULTS.nonlinear_max_steps_reached)
# what became of a search, as files have it: a number for each, which later versions may add to and not change
OUTCOMES = (
    "successful",
    "nonlinear_max_steps_reached",
    "nonlinear_divergence",
    "nonfinite",
    "nan_start",
    "not_stationary",
    "indefinite_inertia",
    "other",
)


def outcome_numbers(result: RESULTS) -> np.ndarray:
    """The index to `OUTCOMES` of each `result`, of any shape; the last for what is none of the others."""
    numbers = np.full(np.shape(result == RESULTS.successful), len(OUTCOMES) - 1, np.int8)
    for number, name in enumerate(OUTCOMES[:-1]):
        numbers[np.asarray(result == getattr(RESULTS, name))] = number
    return numbers
