"""The logs that vehicles write: PX4's ULog, MCAP, ROS bags and Slocum files, as recordings of chosen channels.

A log holds many channels, each on its own times. `contents` lists them; `load_log` takes those that a `Selection`
names, turns them the way this package counts, and puts them onto one column of times.
"""

from .load import SUFFIXES, contents, load_log, opened
from .log import Channel, Listing, Log, Series
from .merge import merged
from .selection import Selection, read_selection

__all__ = [
    "SUFFIXES",
    "Channel",
    "Listing",
    "Log",
    "Selection",
    "Series",
    "contents",
    "load_log",
    "merged",
    "opened",
    "read_selection",
]
