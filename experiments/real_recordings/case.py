"""One question to a real recording: a vehicle file, the runs to fit and those to judge by, and field units."""

import dataclasses
from collections.abc import Mapping, Sequence

from jaxsub.recording import Recording

FieldUnit = tuple[float, str]
DEGREES = 57.29577951308232


@dataclasses.dataclass(frozen=True)
class Case:
    """A vehicle file's text, its recordings and how they were prepared.

    `channels` gives for each measured channel the factor from SI and the unit in which its field writes errors;
    `parameters` does so for an effect's parameters and the coefficients, by symbol, where that unit is not the file's.
    `picked` are `[[effects]]` tables that the literature would add by hand, the yardstick for what was found.
    `published` are figures of others for the same question, with the metric in their key.
    """

    vehicle: str
    train: Sequence[Recording]
    held: Sequence[Recording]
    prepared: str
    channels: Mapping[str, FieldUnit]
    picked: str
    parameters: Mapping[str, FieldUnit] = dataclasses.field(default_factory=dict)
    published: Mapping[str, float | str] = dataclasses.field(default_factory=dict)
