"""How much more probable one model is than another, as far as the recordings agree on it."""

from collections.abc import Sequence

import numpy as np
from scipy import special

from .show import HeldOut, block_gains

# the least variance of a difference in log evidence: of models that expect the same it is none
_TINY = 1e-12


def told_apart(evidence: Sequence[float], shown: Sequence[HeldOut], samples: int) -> list[float]:
    r"""Log evidence of models by all runs: by `samples` that they were fitted to, and what is `shown` on the others.

    As the others are predicted from those fitted, evidence is of both, $\ln p(y) + \ln p(y' | y)$. A model is behind
    the best by as much of that as is `believed`, whose variance is told by B blocks of the n' other samples,
    $s^2 = (1 + n/n') B\,\mathrm{var}(t)$ with t by how much each prefers the best: the n that were fitted are taken to
    be like them. Only the evidence of the fits counts where all diverge along the others.
    """
    whole = np.array(evidence) + [sum(float(run.sum()) for run in one.expected) for one in shown]
    best = int(np.argmax(whole))
    if not np.isfinite(whole[best]):
        return [*evidence]
    leader = shown[best].expected
    # where nothing was measured nothing is added to the likelihood
    others = sum(np.count_nonzero(run) for run in leader)
    for i, one in enumerate(shown):
        if not np.isfinite(whole[i]):
            continue
        blocks = block_gains(leader, one.expected)
        variance = (1.0 + samples / max(others, 1)) * len(blocks) * float(np.var(blocks, ddof=1))
        whole[i] = whole[best] - believed(whole[best] - whole[i], variance)
    return whole.tolist()


def believed(ahead: float, variance: float) -> float:
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
