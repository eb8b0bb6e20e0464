"""Vehicle files to start from: coefficients estimated from main dimensions, inputs and outputs those of a log."""

from .file import InitialFile
from .kinds import KINDS, initial_file
from .rig import rig_file
from .sizes import SIZES
from .stated import begun, read_geometry

__all__ = [
    "KINDS",
    "SIZES",
    "InitialFile",
    "begun",
    "initial_file",
    "read_geometry",
    "rig_file",
]
