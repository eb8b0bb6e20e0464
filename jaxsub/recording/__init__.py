"""Recordings: one run's samples, the files they are read from and written to, and their division in time."""

from jaxsub.recording.division import hold_out, split
from jaxsub.recording.files import contents, is_log, load, load_in_order, save
from jaxsub.recording.frames import from_pandas, from_xarray, to_pandas, to_xarray
from jaxsub.recording.logs import Selection, load_log, read_selection
from jaxsub.recording.recording import Recording

__all__ = [
    "Recording",
    "Selection",
    "contents",
    "from_pandas",
    "from_xarray",
    "hold_out",
    "is_log",
    "load",
    "load_in_order",
    "load_log",
    "read_selection",
    "save",
    "split",
    "to_pandas",
    "to_xarray",
]
