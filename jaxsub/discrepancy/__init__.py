"""The heart: locate the mismatch, name what was left out, model it, show that it helps."""

from .diagnose import batch, diagnose
from .diagnosis import Diagnosis

__all__ = ["Diagnosis", "batch", "diagnose"]
