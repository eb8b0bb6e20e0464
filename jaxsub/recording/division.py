"""Division of recordings in time, into training and test runs."""

from collections.abc import Sequence

from jaxsub.errors import InputError
from jaxsub.recording.recording import Recording


def split(recording: Recording, fraction: float = 0.7) -> tuple[Recording, Recording]:
    """Divide `recording` at `fraction` of its duration into (first, rest), which share no sample.

    Raises InputError when either would have fewer than two samples.
    """
    early = recording.times <= recording.times[0] + fraction * recording.duration
    count = int(early.sum())
    if min(count, len(early) - count) < 2:
        what = f"dividing it at {fraction:g} of its time leaves {count} and {len(early) - count} samples"
        raise InputError(recording.source, what, "each part needs two: give a longer run or a second run")
    return recording.select(early), recording.select(~early)


def hold_out(recordings: Sequence[Recording], fraction: float = 0.7) -> tuple[list[Recording], list[Recording]]:
    """Return (training, test): the last of `recordings` is the test run or, of a single one, what follows `fraction`.

    Raises InputError when there is no run, or a single run is too short to divide.
    """
    if not recordings:
        raise InputError("recordings", "none was given", "name at least one run")
    if len(recordings) == 1:
        first, rest = split(recordings[0], fraction)
        return [first], [rest]
    return list(recordings[:-1]), [recordings[-1]]
