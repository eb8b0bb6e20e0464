"""The tables of this experiment's page."""

from typing import Any

from ..tables import table

_SETS = ("fresh", "practised")


def tables(results: dict[str, Any]) -> dict[str, str]:
    """By condition the cases answered rightly, and what else was measured, of fresh and of practised cases."""
    conditions = [row["condition"] for row in results[_SETS[0]]["conditions"]]
    rows = [[name, *(_right(results[one], name) for one in _SETS)] for name in conditions]
    return {
        "today, by condition": table(["right answers", *_SETS], rows),
        "today, also measured": table(["also measured", *_SETS], _also(results)),
    }


def _right(found: dict[str, Any], condition: str) -> str:
    return _rate(next(row["right"] for row in found["conditions"] if row["condition"] == condition))


def _rate(rate: dict[str, Any]) -> str:
    """Hits of trials, with the 95 % interval in percent."""
    if not rate["n"]:
        return "–"
    low, high = (100.0 * end for end in rate["interval"])
    return f"{round(rate['rate'] * rate['n'])} of {rate['n']} ({low:.0f}–{high:.0f} %)"


def _also(results: dict[str, Any]) -> list[list[str]]:
    alarms = lambda found: [rate for rate in found["false_alarm"].values() if rate["n"]]
    told = {
        "false alarms": lambda found: (
            f"{sum(round(r['rate'] * r['n']) for r in alarms(found))} of {sum(r['n'] for r in alarms(found))}"
        ),
        "first place right": lambda found: _rate(found["located"]["strict"]),
        "parameters within their 95 % interval": lambda found: _rate(found["coverage"]),
        "test error within 10 % of the floor": lambda found: _rate(found["held_out"]["within_10_percent"]),
        "median and longest time of a case, s": lambda found: (
            f"{found['seconds']['median']:.0f}, {found['seconds']['largest']:.0f}"
        ),
    }
    return [[name, *(say(results[one]) for one in _SETS)] for name, say in told.items()]
