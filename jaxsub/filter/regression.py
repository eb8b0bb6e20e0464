r"""Linear fuzzy regression over a window, solved exactly (the second paper's eqs. 19 to 22).

$\Delta x(t) = A_0 + A_1 t$ with symmetric triangular $A_i$ of centre $p_i$ and spread $c_i$, and t from the window's
first sample, where eq. 20 without a modulus holds:

$$\min \sum_j (c_0 + c_1 t_j) \quad\text{subject to}\quad
|x_j - p_0 - p_1 t_j| \le (1 - h)(c_0 + c_1 t_j), \qquad c_i \ge 0.$$

With $c' = (1 - h)c$ the band's edges are two lines, $U$ of slope $p_1 + c'_1$ over all samples and $L$ of slope
$p_1 - c'_1$ under them, and the sum is that of $(U - L)/2$. $c_0 \ge 0$ holds by itself, there being a sample at t = 0;
$c_1 \ge 0$ says that U is not the less steep. Let U of slope s touch the samples, at height $F(s)$ at their mean time,
and L likewise at $G(s)$. F is convex, G concave, both piecewise linear with corners at slopes between two samples only.
So either F is least and G greatest at slopes in the right order, or $c_1 = 0$ and $F(s) - G(s)$ is least: all three are
looked up in one table over the m(m - 1)/2 pairs of samples, which takes the order of m³ operations.

Source: Tanaka, Uejima and Asai (1982), IEEE Trans. Systems, Man and Cybernetics 12.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from ..errors import InputError

# what several operations and the rounding of the times may do to a table entry
_ROUNDINGS = 1.0
# samples taken into the table at once: enough for the windows in use, few enough to compile fast
_UNROLL = 16


class FuzzyLine(eqx.Module):
    """A line with triangular fuzzy coefficients, or with leading axes many.

    **Fields**

    - `origin`: s, the time from which the line counts.
    - `centre`: (2,) p₀ and p₁, the units of the values and those per second.
    - `spread`: (2,) c₀ and c₁, neither negative, in the same units.
    """

    origin: Float[Array, "*k"]
    centre: Float[Array, "*k 2"]
    spread: Float[Array, "*k 2"]

    def at(self, time: Float[Array, "*k"] | float) -> tuple[Float[Array, "*k"], Float[Array, "*k"]]:
        """Centre and spread of the line's value at `time` on the clock of the samples; one time a line."""
        t = time - self.origin
        centre, spread = self.centre, self.spread
        return centre[..., 0] + centre[..., 1] * t, spread[..., 0] + spread[..., 1] * jnp.abs(t)


def fuzzy_line(
    times: Float[Array, " m"],
    values: Float[Array, " m"],
    mask: Bool[Array, " m"],
    level: Float[Array, ""] | float = 0.0,
) -> FuzzyLine:
    r"""The fuzzy line of least total spread whose band at membership `level` h, 0 ≤ h < 1, holds all samples of `mask`.

    Times may come in any order, and several samples at one time. Where rounding of the data does not tell slopes
    apart, such as in a uniform window whose middle sample is a corner of the hull, the answer is the middle one of all
    optima, so mirrored values give the mirrored line. Of samples at one time, or of a single one, slope and c₁ are
    zero and c₀ is half their range over (1 - h); without any sample all is zero.

    The answer is differentiable by times, values and level where the set of samples that the band touches does not
    change. Elsewhere, among tied samples, the derivative is that of one of the adjoining pieces or a mean of them; a
    middle of several optima is differentiated as the middle of the same two slopes, as if moving a time kept the tie.

    **Raises**: `InputError` for a `level` given as a number outside [0, 1).
    """
    if isinstance(level, float) and not 0.0 <= level < 1.0:
        raise InputError("fuzzy_line", f"membership level {level:g}", "0 ≤ level < 1 is needed")
    first = jnp.argmax(mask)
    # copies of a sample change nothing, so they fill the places of missing ones
    times, values = (jnp.where(mask, a, jnp.where(jnp.any(mask), a[first], 0.0)) for a in (times, values))
    origin, reference = jnp.min(times), jax.lax.stop_gradient(values[first])
    t, x = times - origin, values - reference
    low, high = _steepness(t, x, mask, jnp.max(jnp.abs(times)))
    upper, lower = jnp.max(x - high * t), jnp.min(x - low * t)
    return FuzzyLine(
        origin,
        jnp.stack([reference + 0.5 * (upper + lower), 0.5 * (high + low)]),
        0.5 * jnp.stack([upper - lower, high - low]) / (1.0 - level),
    )


def _steepness(
    t: Float[Array, " m"],
    x: Float[Array, " m"],
    mask: Bool[Array, " m"],
    latest: Float[Array, ""],
) -> tuple[Float[Array, ""], Float[Array, ""]]:
    """The slopes of L and U; `latest` bounds the times as they were given, and rounded."""
    rounding = _ROUNDINGS * jnp.finfo(x.dtype).eps
    # exact products with 1, 0 and -1: the derivative of indexing is slow on a CPU
    differences = jnp.asarray(_pairs(len(x)), x.dtype)
    apart, rise = (jnp.matmul(differences, a, precision="highest") for a in (t, x))
    distinct = jnp.abs(apart) > rounding * latest
    slopes = jnp.where(distinct, rise, 0.0) / jnp.where(distinct, apart, 1.0)
    # the table chooses among the slopes and is not differentiated
    mean = jnp.sum(jnp.where(mask, t, 0.0)) / jnp.maximum(jnp.sum(mask), 1)
    s, about, x = jax.lax.stop_gradient((slopes, t - mean, x))
    F, G = _touching(s, about, x)
    slack = rounding * (jnp.max(jnp.abs(x)) + jnp.abs(s) * latest)
    high, low, both = (
        _middle(slopes, jnp.where(distinct, cost, jnp.inf), allowed)
        for cost, allowed in ((F, slack), (-G, slack), (F - G, 2.0 * slack))
    )
    ordered = high >= low
    return jnp.where(ordered, low, both), jnp.where(ordered, high, both)


def _pairs(m: int) -> np.ndarray:
    """Rows that take the differences of m samples; one is of a sample to itself, so that a single one has a row."""
    one, other = np.triu_indices(m, 1)
    return np.eye(m)[np.append(other, 0)] - np.eye(m)[np.append(one, 0)]


def _touching(
    s: Float[Array, " k"], t: Float[Array, " m"], x: Float[Array, " m"]
) -> tuple[Float[Array, " k"], Float[Array, " k"]]:
    """The heights at t = 0 of the lines of slopes `s` that touch the samples from above and from below."""

    # a loop over samples: reductions along an axis are ten times slower on a CPU
    def include(heights: tuple[Array, Array], sample: tuple[Array, Array]) -> tuple[tuple[Array, Array], None]:
        height = sample[1] - s * sample[0]
        return (jnp.maximum(heights[0], height), jnp.minimum(heights[1], height)), None

    none = jnp.full_like(s, -jnp.inf)
    return jax.lax.scan(include, (none, -none), (t, x), unroll=_UNROLL)[0]


def _middle(slopes: Float[Array, " k"], cost: Float[Array, " k"], slack: Float[Array, " k"]) -> Float[Array, ""]:
    """The middle of the slopes of least cost, each known to within its `slack`; without a finite cost that of all."""
    best = cost - slack <= jnp.min(cost + slack)
    least = jnp.min(jnp.where(best, slopes, jnp.inf))
    most = jnp.max(jnp.where(best, slopes, -jnp.inf))
    return 0.5 * (least + most)
