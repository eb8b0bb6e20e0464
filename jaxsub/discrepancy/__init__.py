"""Discrepancy: locate the mismatch, name what was left out, model it, show that it helps."""

from .diagnosis import Conclusions
from .procedure import diagnose

__all__ = ["Conclusions", "diagnose"]
