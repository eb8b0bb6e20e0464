"""Discrepancy: locate the mismatch, name what was left out, model it, show that it helps."""

from .procedure import diagnose
from .records.diagnosis import Conclusions

__all__ = ["Conclusions", "diagnose"]
