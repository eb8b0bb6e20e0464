r"""How many independent tests all candidates together are worth.

Where nothing is missing, the products b of the candidates' columns S with a whitened residual are N(0, G), with
$G = S^TS$ less what the free parameters absorb. Candidates that resemble each other are then significant together. With
$p_i = P(\chi^2 \ge b_i^T(G_{ii} + \pi I)^{-1}b_i)$, π the precision of an amplitude's prior, the distribution of
$\min_i p_i$ is simulated by drawing b, and its quantile $q_\alpha$ at a level α gives the number m of independent tests
with the same one, $1 - (1 - q_\alpha)^m = \alpha$. So $1 - (1 - p)^m$ is the family-wise p-value of the smallest p.
Sources: Westfall and Young (1993), Resampling-Based Multiple Testing; Šidák (1967), J. Am. Stat. Assoc. 62.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from scipy import special

from .. import settings

# of which a hundredth determine the quantile, to a tenth of its size
_DRAWS, _SEED = 10_000, 0


def independent_tests(squares: Float[np.ndarray, "q q"], owners: Sequence[Sequence[int]], precision: float) -> float:
    """The number of independent tests that candidates are worth, by the products `squares` of their columns.

    `owners` are the columns of each, `precision` that of an amplitude's prior. At least one.
    """
    if not owners:
        return 1.0
    columns = sorted({column for own in owners for column in own})
    place = {column: at for at, column in enumerate(columns)}
    G = squares[np.ix_(columns, columns)]
    values, vectors = np.linalg.eigh(0.5 * (G + G.T))
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    b = root @ np.random.default_rng(_SEED).standard_normal((len(columns), _DRAWS))
    # of the candidates with as many columns the largest statistic has the smallest p-value
    largest: dict[int, np.ndarray] = {}
    for own in owners:
        at = [place[column] for column in own]
        statistic = np.sum(b[at] * np.linalg.solve(G[np.ix_(at, at)] + precision * np.eye(len(at)), b[at]), axis=0)
        largest[len(at)] = np.maximum(largest.get(len(at), 0.0), statistic)
    p = np.min([special.chdtrc(size, most) for size, most in largest.items()], axis=0)
    quantile = min(float(np.quantile(p, settings.SIGNIFICANCE)), settings.SIGNIFICANCE)
    return float(np.log1p(-settings.SIGNIFICANCE) / np.log1p(-quantile))


def family_wise(p_value: float, tests: float) -> float:
    """The p-value of the smallest of so many independent `tests`."""
    return float(-np.expm1(tests * np.log1p(-min(p_value, 1.0 - 1e-16))))
