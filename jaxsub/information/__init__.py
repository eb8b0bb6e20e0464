"""Identifiability: which coefficients, and which combinations of them, the recordings determine."""

from .coefficients import Estimate, estimates
from .coloured import Coloured, coloured_covariance
from .design_information import Information, information
from .design_limits import Limits
from .equivalence import Equivalent, Family, equivalent_systems
from .manoeuvre_design import Design, design, keeping
from .profiles import Profile, profile
from .rank import Identifiability, Verdict, identifiability, identifiable_subset

__all__ = [
    "Coloured",
    "Design",
    "Equivalent",
    "Estimate",
    "Family",
    "Identifiability",
    "Information",
    "Limits",
    "Profile",
    "Verdict",
    "coloured_covariance",
    "design",
    "equivalent_systems",
    "estimates",
    "identifiability",
    "identifiable_subset",
    "information",
    "keeping",
    "profile",
]
