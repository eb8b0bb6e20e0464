"""The tables of this experiment's page."""

from collections import Counter
from typing import Any

from ..tables import table
from .assemble import GROUPS, SEVERAL
from .scoring import rate

_PEERS = {"pysindy": "PySINDy", "stepwise_aic": "stepwise AIC", "stepwise_bic": "stepwise BIC"}


def tables(results: dict[str, Any]) -> dict[str, str]:
    """Right answers by condition, beside them peers', what else was measured, and what was wrong, by set of cases."""
    rows = {group: _rows(results, names) for group, names in GROUPS.items()}
    rows[SEVERAL].append(["all cases, clean ones among them", *(_rate(one["right"]) for one in results.values())])
    return {group: table([group, *results], of) for group, of in rows.items()} | {
        "false alarms": table(["nothing concealed", *_twice(results)], _clean(results)),
        "also measured": table(["also measured", *results], _also(results)),
        "wrong": table(["wrong answers", "cases", "conditions"], _wrong(results)),
        "peers": table(["right answers", *GROUPS], _peers(next(iter(results.values())))),
    }


def _rows(results: dict[str, Any], names: list[str]) -> list[list[str]]:
    right = lambda one, name: _rate(next(row["right"] for row in one["conditions"] if row["condition"] == name))
    return [[name, *(right(one, name) for one in results.values())] for name in names]


def _rate(of: dict[str, Any]) -> str:
    """Hits of trials, with the 95 % interval in percent."""
    if not of["n"]:
        return "–"
    low, high = (100.0 * end for end in of["interval"])
    return f"{round(of['rate'] * of['n'])} of {of['n']} ({low:.0f}–{high:.0f} %)"


def _twice(results: dict[str, Any]) -> list[str]:
    return [f"{name}: {what}" for name in results for what in ("verdict `none`", "false alarms")]


def _clean(results: dict[str, Any]) -> list[list[str]]:
    """By kind of clean cases and of all, how many verdicts are `none`, and how many name an effect."""
    said = {
        "none_white": "white noise", "none_coloured": "coloured disturbance", "none_half": "sigma stated as half",
        "none_double": "sigma stated as double", "none_logs": "recorded as logs are",
    }  # fmt: skip
    rows = [
        [label, *(_rate(one[what][kind]) for one in results.values() for what in ("clean", "false_alarm"))]
        for kind, label in said.items()
    ]
    total = lambda one: next(row["right"] for row in one["conditions"] if row["condition"] == "nothing concealed")
    return [*rows, ["all", *(_rate(part) for one in results.values() for part in (total(one), one["false_alarms"]))]]


def _also(results: dict[str, Any]) -> list[list[str]]:
    columns = {
        "first place right": lambda one: _rate(one["located"]["strict"]),
        "parameters within their 95 % interval": lambda one: _rate(one["coverage"]),
        "names stated with 0.97 or more that are true": lambda one: _certain(one["calibration"]),
        "test error within 10 % of the noise": lambda one: _rate(one["held_out"]["within_10_percent"]),
        "of ten effects named; false names": lambda one: _many(one["many"]),
        "cases that could not be made": lambda one: f"{len(one['not_made'])}",
        "CPU seconds of a case: median, longest": lambda one: _seconds(one["cpu_seconds"]),
        "engine": lambda one: ", ".join(one["engines"]),
    }
    return [[name, *map(say, results.values())] for name, say in columns.items()]


def _certain(bins: list[dict[str, Any]]) -> str:
    last = bins[-1] if bins and bins[-1]["stated"] >= 0.97 else None
    return _rate(last) if last else "–"


def _many(counts: list[dict[str, Any]]) -> str:
    """Of each case how many of its many effects are named, and how many false names all have."""
    if not counts:
        return "–"
    return f"{', '.join(str(one['true']) for one in counts)}; {sum(one['false'] for one in counts)}"


def _seconds(seconds: dict[str, float]) -> str:
    return f"{seconds['median']:.0f}, {seconds['largest']:.0f}" if seconds else "–"


def _wrong(results: dict[str, Any]) -> list[list[str]]:
    """Wrong answers of all sets by what is wrong, and the conditions in which they are, with their numbers."""
    kinds: dict[str, Counter[str]] = {}
    for case in (case for found in results.values() for case in found["cases"] if not case["right"]):
        kinds.setdefault(case["wrong"], Counter())[case["case"].rsplit("-", 1)[0]] += 1
    rows = sorted(kinds.items(), key=lambda item: -item[1].total())
    return [[kind, f"{of.total()}", ", ".join(f"{c} {n}" for c, n in of.most_common())] for kind, of in rows]


def _peers(found: dict[str, Any]) -> list[list[str]]:
    """The share right in each group of conditions, of the engine and of others on the same files."""
    peers = {name: found["peers"][key] for key, name in _PEERS.items()}
    answers = {name: one["conditions"] for name, one in ({"jaxsub": found} | peers).items()}
    return [[name, *(_rate(_pooled(rows, names)) for names in GROUPS.values())] for name, rows in answers.items()]


def _pooled(rows: list[dict[str, Any]], names: list[str]) -> dict[str, Any]:
    of = [row["right"] for row in rows if row["condition"] in names]
    hits, trials = sum(round((one["rate"] or 0.0) * one["n"]) for one in of), sum(one["n"] for one in of)
    return rate(k < hits for k in range(trials))
