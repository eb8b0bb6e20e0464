"""The heart: locate the mismatch, name what was left out, model it, show that it helps."""

from .batch import batch
from .diagnose import diagnose
from .diagnosis import Diagnosis

__all__ = ["Diagnosis", "batch", "diagnose"]
