"""Added mass of an ellipsoid in water without bounds."""

import math

from scipy.special import elliprd


def lamb_factors(a: float, b: float, c: float) -> tuple[float, float, float]:
    r"""$\alpha_0, \beta_0, \gamma_0$ of an ellipsoid of semi-axes a, b and c (m); their sum is 2.

    $\alpha_0 = abc\int_0^\infty\frac{d\lambda}{(a^2 + \lambda)\sqrt{(a^2 + \lambda)(b^2 + \lambda)(c^2 + \lambda)}}
    = \tfrac23abc\,R_D(b^2, c^2, a^2)$ with Carlson's symmetric integral, and so in turn. Source: Lamb (1932), §§114
    and 373; DLMF, §19.33.
    """
    squares = (a * a, b * b, c * c)
    factor = lambda i: 2.0 / 3.0 * a * b * c * float(elliprd(squares[i - 2], squares[i - 1], squares[i]))
    return factor(0), factor(1), factor(2)


def added_mass_factors(a: float, b: float, c: float) -> tuple[float, float, float]:
    r"""Added mass in surge, sway and heave by the displaced mass: $\alpha_0/(2 - \alpha_0)$ and so in turn.

    `a`, `b` and `c` are the semi-axes along x, y and z, m. Source: Lamb (1932), §373.
    """
    k_x, k_y, k_z = (factor / (2.0 - factor) for factor in lamb_factors(a, b, c))
    return k_x, k_y, k_z


def added_inertia_factors(a: float, b: float, c: float) -> tuple[float, float, float]:
    r"""Added inertia in roll, pitch and yaw by the displaced water's own, $\tfrac15m(b^2 + c^2)$ and so in turn.

    $k_{xx} = \frac{(b^2 - c^2)^2(\gamma_0 - \beta_0)}{(b^2 + c^2)[2(b^2 - c^2) + (b^2 + c^2)(\beta_0 - \gamma_0)]}$.
    `a`, `b` and `c` are the semi-axes along x, y and z, m. Source: Lamb (1932), §373.
    """
    factors = lamb_factors(a, b, c)

    def about(i: int, j: int) -> float:
        first, second = (a, b, c)[i], (a, b, c)[j]
        if math.isclose(first, second, rel_tol=1e-6):  # a body of revolution moves no water; rounding would tell else
            return 0.0
        apart, total = first**2 - second**2, first**2 + second**2
        slope = factors[i] - factors[j]
        return -(apart**2) * slope / (total * (2.0 * apart + total * slope))

    return about(1, 2), about(2, 0), about(0, 1)
