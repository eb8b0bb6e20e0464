"""Recordings: one run's samples, the files they are read from and written to, and their division in time."""

from jaxsub.recording.files import load, save
from jaxsub.recording.recording import Recording
from jaxsub.recording.split import hold_out, split

__all__ = ["Recording", "hold_out", "load", "save", "split"]
