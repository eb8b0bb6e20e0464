"""Coefficients estimated from a vehicle's main dimensions: potential flow, skin friction, strip theory, lift."""

from .drag import crossflow_drag, form_factor, friction_drag, skin_friction
from .ellipsoid import added_inertia_factors, added_mass_factors, lamb_factors
from .lift import hull_lift, lift_slope

__all__ = [
    "added_inertia_factors",
    "added_mass_factors",
    "crossflow_drag",
    "form_factor",
    "friction_drag",
    "hull_lift",
    "lamb_factors",
    "lift_slope",
    "skin_friction",
]
