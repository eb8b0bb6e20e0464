"""Identifiability: which coefficients, and which combinations of them, the recordings determine."""

from .coefficients import CoefficientEstimate, estimates
from .coloured import Coloured, coloured_covariance
from .design_information import Information, information
from .design_limits import ManoeuvreLimits
from .equivalence import Equivalent, Family, equivalent_systems
from .manoeuvre_design import Design, design, keeping
from .profiles import Profile, profile
from .rank import CoefficientVerdict, Identifiability, identifiability, identifiable_subset

__all__ = [
    "CoefficientEstimate",
    "CoefficientVerdict",
    "Coloured",
    "Design",
    "Equivalent",
    "Family",
    "Identifiability",
    "Information",
    "ManoeuvreLimits",
    "Profile",
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
