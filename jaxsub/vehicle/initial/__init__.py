"""Vehicle files to start from: coefficients estimated from main dimensions, inputs and outputs those of a log."""

from .file import InitialFile
from .kinds import KINDS, initial_file
from .like import PUBLISHED, published_file
from .rig import rig_file
from .sizes import SIZES

__all__ = ["KINDS", "PUBLISHED", "SIZES", "InitialFile", "initial_file", "published_file", "rig_file"]
