"""The manoeuvre that would settle an ambiguous diagnosis: its rivals fitted, and inputs that separate them."""

from collections.abc import Sequence

import jax.numpy as jnp

from ...estimate import batch, search
from ...information.separating_manoeuvre import Manoeuvre, separating_manoeuvre
from ...recording import Recording
from ..records.diagnosis import Conclusions

# s: a longer one costs more than it separates
_LONGEST = 120.0


def next_run(diagnosis: Conclusions, train: Sequence[Recording]) -> Manoeuvre | None:
    """The inputs whose recording would best separate the diagnosis' explanations of the runs `train`.

    It begins as the first of them, within the limits that it kept. None where nothing is ambiguous or nothing can be
    moved.
    """
    models = diagnosis.explanations
    if len(models) < 2 or not models[0].layout.held:
        return None
    sigma = jnp.asarray([channel.sigma for channel in diagnosis.channels])
    fitted = [search(model, batch(model, train), sigma=sigma).vehicle for model in models]
    return separating_manoeuvre(fitted, train[0], sigma, duration=min(train[0].duration, _LONGEST))


def sentence(found: Manoeuvre, file: str) -> str:
    """One sentence on a manoeuvre that was written to `file`."""
    gain = f"{found.separation:.3g} (χ² between the closest two; {found.before:.3g} with the inputs recorded here)"
    return f"The inputs in {file}, found for this vehicle within the limits it kept, should tell them apart by {gain}."
