"""What the test runs show of the models, once all is decided."""

import dataclasses
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from ...estimate.assessment import Assessment
from ...recording import Recording
from ...vehicle import AbstractVehicle
from ..accept.acceptance import Model
from ..records.diagnosis import ChannelQuality, Explained, Gain, Remainder
from .consistency import assessed, compared, expected_errors, noise
from .evaluation import Evaluation, evaluated, test_gain
from .validation import remainders


@dataclasses.dataclass(frozen=True)
class Shown:
    """The baseline `before` and the improved model `after` on the test runs; one and the same where nothing is better.

    **Fields**

    - `remains`: what each leaves, by model and channel. `explained`: what the improved one removes.
    - `low`: the low ends of the intervals of the improved one's errors over the noise, by channel.
    - `assessment`: the tests of what the improved one leaves. `gain`: none where there is no improved model.
    """

    before: Evaluation
    after: Evaluation
    remains: dict[str, dict[str, Remainder]]
    explained: Explained
    low: dict[str, float]
    assessment: Assessment
    gain: Gain | None

    @property
    def left(self) -> dict[str, Remainder]:
        """What the last model leaves, by channel."""
        return [*self.remains.values()][-1]

    def history(self, sigma: Float[np.ndarray, " c"]) -> list[tuple[str, dict[str, float]]]:
        """The rms error of each model by channel, SI."""
        rms = {"baseline": self.before.rms, "improved": self.after.rms}
        scaled = lambda one: {c: value * float(s) for (c, value), s in zip(one.items(), sigma, strict=True)}
        return [(label, scaled(rms[label])) for label in self.remains]


def shown_on(
    test: Sequence[Recording],
    vehicle: AbstractVehicle,
    train: Sequence[Recording],
    models: Sequence[Model],
    quality: Sequence[ChannelQuality],
) -> Shown | None:
    """The baseline, and the improved model if it is among `models`, simulated along the runs `test`, if there are any.

    `quality` is that of the channels in the training runs, by the improved model.
    """
    if not test:
        return None
    layout, sigma, pieces = vehicle.layout, np.asarray(models[0].fit.sigma), models[-1].pieces
    found = evaluated(vehicle, train, test, models, pieces)
    before, after = found[0], found[-1]
    labels = ["baseline", "improved"][: len(models)]
    remains = {label: remainders(one.error, test, layout, sigma) for label, one in zip(labels, found, strict=True)}
    scale = noise(quality)
    over = lambda values: {c: value * float(r) for (c, value), r in zip(values.items(), sigma / scale, strict=True)}
    low = [over({channel: one.low for channel, one in left.items()}) for left in remains.values()]
    assessment = assessed(after.error, test, layout.measured, scale)
    expected = expected_errors(models[-1].view, scale, quality) if assessment.oversized else {}
    explained = compared(over(before.rms), over(after.rms), low[0], expected, assessment)
    gain = test_gain(before, after, pieces) if len(models) > 1 else None
    return Shown(before, after, remains, explained, low[-1], assessment, gain)
