"""Identifiability: which coefficients, and which combinations of them, the recordings determine."""

from .rank import Identifiability, identifiability

__all__ = ["Identifiability", "identifiability"]
