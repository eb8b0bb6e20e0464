"""Each sentence of the paper's section 6 and of its conclusion, against the distribution of runs.

A claim that compares two rules holds if it is true of more than half of the seeds, run by run with the same noise, the
95 % interval of that share included.
"""

from collections.abc import Mapping

import numpy as np

from jaxsub.estimate import Rate

from .bench import DEGREE, INTERVAL, TURN
from .pitch_runs import Runs

COMPARED = (14.1, 35.1, 44.6)  # the angles of Figs 6 to 8
PerSeed = Mapping[tuple[float, str], Mapping[str, np.ndarray]]


def examined(per_seed: PerSeed, traces: Mapping[tuple[float, str], Runs]) -> list[dict]:
    """The claims in the paper's order."""
    return [
        _within_one_percent(per_seed),
        _magnitude(per_seed),
        _smaller_deviates_more(per_seed),
        _compared(per_seed, "6.3 maximum overshoot is much larger with fuzzy noise", "overshoot_pct", 2.0),
        _compared(per_seed, "6.3 settling takes significantly longer with random noise", "settling_s", None),
        _steady(per_seed),
        _from_below(traces),
        _oscillation(per_seed),
        _compared(per_seed, "7 fuzzy noise converges faster", "settling_s", None),
        _compared(per_seed, "7 fuzzy noise has the better steady state", "steady_rms_deg", None),
    ]


def _within_one_percent(per_seed: PerSeed) -> dict:
    """Error of the tracked angle in the steady state."""
    share = {a: 100.0 * np.median(per_seed[a, "fuzzy"]["steady_rms_deg"]) / a for a in (4.4, 17.4, 28.2)}
    return _claim("6.2 tracking within 1 per cent", all(value < 1.0 for value in share.values()), share, "Figs 2-4")


def _magnitude(per_seed: PerSeed) -> dict:
    """Settling of the fuzzy rule at the three angles of Figs 2 to 4."""
    times = {a: float(np.median(per_seed[a, "fuzzy"]["settling_s"])) for a in (4.4, 17.4, 28.2)}
    similar = max(times.values()) < 1.5 * min(times.values())
    return _claim("6.2 the angle's magnitude has no significant effect on tracking", similar, times, "Figs 2-4")


def _smaller_deviates_more(per_seed: PerSeed) -> dict:
    share = {a: 100.0 * float(np.median(per_seed[a, "fuzzy"]["steady_rms_deg"])) / a for a in (29.1, 15.7, 3.05)}
    holds = share[3.05] > share[15.7] > share[29.1]
    degrees = {f"{a} in degrees": float(np.median(per_seed[a, "fuzzy"]["steady_rms_deg"])) for a in share}
    return _claim(
        "6.2 the smaller the angle, the larger the steady deviation in per cent", holds, share | degrees, "Fig. 5"
    )


def _compared(per_seed: PerSeed, text: str, metric: str, ratio: float | None) -> dict:
    """`metric` of the two rules at the angles of Figs 6 to 8; an overshoot is claimed larger, the others smaller."""
    figures, holds = {}, True
    for a in COMPARED:
        fuzzy, random = per_seed[a, "fuzzy"][metric], per_seed[a, "random"][metric]
        rate = Rate(int(np.sum(fuzzy > (ratio or 1.0) * random if ratio else fuzzy < random)), len(fuzzy))
        figures[a] = {
            "fuzzy": float(np.median(fuzzy)),
            "random": float(np.median(random)),
            "share_of_seeds": rate.share,
            "interval": list(rate.interval),
            "random_half_the_range": float(np.median(per_seed[a, "random_half"][metric])),
            "random_twice_the_range": float(np.median(per_seed[a, "random_double"][metric])),
        }
        holds &= rate.interval[0] > 0.5
    return _claim(text, holds, figures, "Figs 6-8")


def _steady(per_seed: PerSeed) -> dict:
    figures, holds = {}, True
    for a in COMPARED:
        fuzzy, random = (np.abs(per_seed[a, name]["steady_mean_deg"]) for name in ("fuzzy", "random"))
        rate = Rate(int(np.sum(random > fuzzy)), len(fuzzy))
        over = Rate(int(np.sum(per_seed[a, "random"]["steady_mean_deg"] > 0.0)), len(fuzzy))
        figures[a] = {"share_worse": rate.share, "share_above": over.share, "random_deg": float(np.median(random))}
        holds &= rate.interval[0] > 0.5
    return _claim(
        "6.3 the steady-state error is higher with random noise, with a tendency to overshoot",
        holds,
        figures,
        "Figs 6-8",
    )


def _from_below(traces: Mapping[tuple[float, str], Runs]) -> dict:
    """The random rule's estimate below the fuzzy rule's in the first 5 s, above zero error at some time after."""
    figures, holds = {}, True
    for a in COMPARED:
        early = slice(TURN, TURN + round(5.0 / INTERVAL))
        fuzzy, random = traces[a, "fuzzy"].pitch, traces[a, "random"].pitch
        below = np.mean(random[:, early] - fuzzy[:, early], axis=1) < 0.0
        crosses = np.max(random[:, TURN:], axis=1) > a * DEGREE
        rate = Rate(int(np.sum(below & crosses)), len(below))
        figures[a] = {"share_of_seeds": rate.share, "interval": list(rate.interval)}
        holds &= rate.interval[0] > 0.5
    text = "6.3 the random curve comes up from below the fuzzy one and crosses to a positive error"
    return _claim(text, holds, figures, "Figs 6-8")


def _oscillation(per_seed: PerSeed) -> dict:
    fuzzy, random = (per_seed[45.7, name]["oscillation_deg"] for name in ("fuzzy", "random"))
    rate = Rate(int(np.sum(random > fuzzy)), len(fuzzy))
    figures = {"fuzzy": float(np.median(fuzzy)), "random": float(np.median(random)), "share_of_seeds": rate.share}
    much = rate.interval[0] > 0.5 and figures["random"] > 1.5 * figures["fuzzy"]
    return _claim("6.3 steady oscillations are much larger with random noise", much, figures, "Fig. 9")


def _claim(text: str, holds: bool, figure: dict, paper: str) -> dict:
    return {
        "claim": text,
        "holds": bool(holds),
        "in_the_paper": paper,
        "measured": {str(k): v for k, v in figure.items()},
    }
