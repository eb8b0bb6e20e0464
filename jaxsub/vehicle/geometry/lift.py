"""Lift of fins by their planform, and of slender hulls."""

import math


def lift_slope(aspect_ratio: float) -> float:
    r"""$C_{L\alpha} = 2\pi\Lambda/(2 + \sqrt{\Lambda^2 + 4})$, 1/rad, of a wing of the `aspect_ratio` $\Lambda$.

    A fin that stands on a hull counts with twice its own ratio. Source: Helmbold (1942), in Hoerner and Borst (1985).
    """
    return 2.0 * math.pi * aspect_ratio / (2.0 + math.hypot(aspect_ratio, 2.0))


def hull_lift(density: float, length: float, diameter: float) -> tuple[float, float]:
    r"""Force by drift of a body of revolution, N/(m/s)², and where it acts, m ahead of the middle.

    $\tfrac12\rho d^2c_{yd}$ with $c_{yd} = 0.003\,(180/\pi)\,\ell/d$ at $0.65\ell$ from the nose; `density` kg/m³,
    `length` $\ell$ and `diameter` d in m. Source: Hoerner (1965), §19, as in Prestero (2001), §4.5.
    """
    slope = math.degrees(0.003) * length / diameter
    return 0.5 * density * diameter**2 * slope, -0.15 * length
