"""Pressure of the water at a depth, and depth at a pressure."""

import math

from ...arrays import Values, namespace
from ...effects import GRAVITY

_PER_DBAR = 1e4  # Pa
_CURVATURE = 2.21e-6  # m/dbar²


def pressure(depth: Values, density: float | None, latitude: float | None) -> Values:
    r"""Pressure (Pa) above the atmosphere's at `depth` (m, positive down).

    $p = \rho g z$ in water of one `density` (kg/m³). At a `latitude` (rad) that of sea water of 35 ‰ and 0 °C:
    $p = \big((1 - c) - \sqrt{(1 - c)^2 - 8.84\cdot10^{-6} z}\big) / 4.42\cdot10^{-6}$ dbar with
    $c = 5.92\cdot10^{-3} + 5.25\cdot10^{-3}\sin^2\varphi$. Source: Saunders (1981), J. Phys. Oceanogr. 11(4).
    """
    if latitude is None:
        return (density or 0.0) * GRAVITY * depth
    xp = namespace(depth)
    linear = 1.0 - _compression(latitude)
    # a root of what is not negative at any depth that a search may try
    root = xp.sqrt(xp.maximum(linear**2 - 4.0 * _CURVATURE * depth, 1e-6))
    # the same as (linear - root) / (2 curvature), without the difference of two near numbers
    return _PER_DBAR * 2.0 * depth / (linear + root)


def depth_at(p: Values, density: float | None, latitude: float | None) -> Values:
    """Depth (m) at the pressure `p` (Pa): the inverse of `pressure`."""
    if latitude is None:
        return p / ((density or 1.0) * GRAVITY)
    dbar = p / _PER_DBAR
    return (1.0 - _compression(latitude)) * dbar - _CURVATURE * dbar**2


def _compression(latitude: float) -> float:
    return 5.92e-3 + 5.25e-3 * math.sin(latitude) ** 2
