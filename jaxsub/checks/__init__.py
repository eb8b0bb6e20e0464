"""Checks of runs before any fit: `check(vehicle, recordings)` gives what was found and the runs as they will be used.

Each family has its module: values that stand for a missing sample, values that cannot be in their unit, angles that
jump by whole turns, holes in time, the same run twice. All of them are NumPy on whole columns.
"""

from .run import Checked, check, from_error

__all__ = ["Checked", "check", "from_error"]
