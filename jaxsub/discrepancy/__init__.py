"""Discrepancy: locate the mismatch, name what was left out, model it, show that it helps."""

from .diagnose import diagnose
from .diagnosis import Diagnosis

__all__ = ["Diagnosis", "diagnose"]
