"""Resistance and damping of hulls: skin friction, and cross-flow drag by strip theory."""

import math

VISCOSITY = 1.19e-6  # kinematic, of sea water at 15 °C, m²/s (ITTC 7.5-02-01-03)
# below it the ITTC line is no longer one of turbulent flow, and rises without bound
_SLOWEST = 1e4


def skin_friction(speed: float, length: float) -> float:
    r"""ITTC-57 friction coefficient $C_F = 0.075/(\log_{10}\mathrm{Re} - 2)^2$ of a hull of `length` m at `speed` m/s.

    Source: ITTC 7.5-02-02-01.
    """
    reynolds = max(speed * length / VISCOSITY, _SLOWEST)
    return 0.075 / (math.log10(reynolds) - 2.0) ** 2


def form_factor(length: float, diameter: float) -> float:
    r"""$1 + k = 1 + 1.5(d/\ell)^{3/2} + 7(d/\ell)^3$ of a streamlined body of revolution, sizes in m.

    Source: Hoerner (1965), §6.
    """
    slenderness = diameter / length
    return 1.0 + 1.5 * slenderness**1.5 + 7.0 * slenderness**3


def friction_drag(density: float, wetted: float, speed: float, length: float, form: float = 1.0) -> float:
    r"""$\tfrac12\rho S(1 + k)C_F$, N/(m/s)², with $C_F$ at `speed` (m/s) and `form` $1 + k$.

    `density` kg/m³, `wetted` surface m², `length` m.
    """
    return 0.5 * density * wetted * form * skin_friction(speed, length)


def crossflow_drag(density: float, length: float, width: float, coefficient: float) -> tuple[float, float]:
    r"""Drag of a strip of even `width` across the flow, and the damping of its turning about the middle.

    $\tfrac12\rho C_DD\ell$, N/(m/s)², and $\tfrac12\rho C_DD\int|x|^3dx = \tfrac1{64}\rho C_DD\ell^4$, N m/(rad/s)²;
    `density` kg/m³, `length` $\ell$ and `width` D in m. Source: Fossen (2021), §6.4.
    """
    half = 0.5 * density * coefficient * width
    return half * length, half * length**4 / 32.0
