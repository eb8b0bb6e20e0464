"""Log evidence of rival models that allows for both being wrong: by how much the blocks of the recordings differ."""

from collections.abc import Sequence

import numpy as np
from scipy import special

from .cross_validation import Predicted

# the least variance of a difference in log evidence: of models that expect the same it is none
_TINY = 1e-12


def robust_log_evidence(evidence: Sequence[float], predicted: Sequence[Predicted]) -> list[float]:
    r"""Log `evidence` of models, with `robust_log_odds` between each and the best.

    The variance of a difference in log evidence is that of the sum of what each of n blocks of the training runs,
    `predicted` from the others, prefers the best by: $s^2 = n\,\mathrm{var}(t)$. A model that diverges has none.
    """
    whole = np.array(evidence)
    best = int(np.argmax(whole))
    if not np.isfinite(whole[best]):
        return [*evidence]
    for i, one in enumerate(predicted):
        blocks = predicted[best].one_step - one.one_step
        if np.isfinite(whole[i]) and np.all(np.isfinite(blocks)):
            variance = len(blocks) * float(np.var(blocks, ddof=1))
            whole[i] = whole[best] - robust_log_odds(whole[best] - whole[i], variance)
    return whole.tolist()


def robust_log_odds(ahead: float, variance: float) -> float:
    r"""The log odds of two models, the one `ahead` by T ≥ 0 in log evidence, a sum whose variance is s².

    Where one of the two is right, the odds are $e^T$, and T is $\pm s^2/2 \pm s$. Where neither is, as of a drag of a
    power between the two, parts of the recordings prefer now the one and now the other, far more than they differ in
    sum: T may be anything within these, and that the one is nearer to the truth has the probability $\Phi(T/s)$ (Vuong
    1989, Econometrica 57). T tells which is so, both as probable before: that is why

    $\ln\frac{P}{1-P} \le T,\quad P = w\,\mathrm{expit}(T) + (1-w)\,\Phi(T/s),\quad
    \frac{w}{1-w} = \frac{N(T; s^2/2, s^2) + N(T; -s^2/2, s^2)}{2\,N(T; 0, s^2 + s^4/4)}$
    """
    variance = max(variance, _TINY)
    s = np.sqrt(variance)
    from scipy import stats

    either = np.logaddexp(*stats.norm.logpdf(ahead, [0.5 * variance, -0.5 * variance], s))
    odds = either - np.log(2.0) - stats.norm.logpdf(ahead, 0.0, np.hypot(s, 0.5 * variance))
    right, neither = special.log_expit(odds), special.log_expit(-odds)
    share = lambda t: np.logaddexp(right + special.log_expit(t), neither + special.log_ndtr(t / s))
    return min(ahead, float(share(ahead) - share(-ahead)))
