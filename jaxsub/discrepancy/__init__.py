"""Discrepancy: locate the mismatch, name what was left out, model it, show that it helps."""

from .diagnosis import Diagnosis
from .procedure import diagnose

__all__ = ["Diagnosis", "diagnose"]
