"""Recordings as the functions of the front door take them: one or several, checked as commands check them."""

from ..checks import Checked, check
from ..findings import require_none
from ..recording.recording import Recordings, listed
from ..vehicle import AbstractVehicle, check_units


def checked(vehicle: AbstractVehicle, recordings: Recordings, held_out: Recordings = ()) -> Checked:
    """What `check` finds in the recordings, none of it an error, and the runs as they will be used.

    **Raises** `InputError` for the first finding that is an error, and for a column in another unit than its channel.
    """
    runs, held = listed(recordings), listed(held_out)
    check_units(vehicle.layout, [*runs, *held])
    found = check(vehicle, runs, held)
    require_none(found.findings)
    return found
