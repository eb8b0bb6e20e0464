"""The tables of this experiment's page."""

from typing import Any

from ..tables import table


def tables(results: dict[str, Any]) -> dict[str, str]:
    """By condition the cases answered rightly, what else was measured, and every wrong answer, by set of cases."""
    conditions = [row["condition"] for row in next(iter(results.values()))["conditions"]]
    rows = [[name, *(_right(found, name) for found in results.values())] for name in conditions]
    rows.append(["all", *(_rate(found["right"]) for found in results.values())])
    return {
        "today, by condition": table(["right answers", *results], rows),
        "today, also measured": table(["also measured", *results], _also(results)),
        "today, wrong": table(["case", "concealed", "size, σ", "answer"], _wrong(results)),
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
    columns = {
        "false alarms": lambda found: _rate(found["false_alarms"]),
        "first place right": lambda found: _rate(found["located"]["strict"]),
        "parameters within their 95 % interval": lambda found: _rate(found["coverage"]),
        "test error within 10 % of the floor": lambda found: _rate(found["held_out"]["within_10_percent"]),
        "engines": lambda found: f"{len(found['engines'])}",
        "cases that could not be made": lambda found: f"{len(found['not_made'])}",
        "answers that ended in an error": lambda found: f"{len(found['failed'])}",
        "median and longest time of a case, s": lambda found: _seconds(found["seconds"]),
    }
    return [[name, *map(say, results.values())] for name, say in columns.items()]


def _seconds(seconds: dict[str, float]) -> str:
    return f"{seconds['median']:.0f}, {seconds['largest']:.0f}" if seconds else "–"


def _wrong(results: dict[str, Any]) -> list[list[str]]:
    """Every case that was answered wrongly, of either set."""
    cases = [case for found in results.values() for case in found["cases"] if not case["right"]]
    return [
        [c["case"], ", ".join(c["concealed"]) or "nothing", f"{c['size']:g}", _answer(c["verdict"], c["names"])]
        for c in cases
    ]


def _answer(verdict: str | None, names: list[list[str]]) -> str:
    """Verdict and names; those of rivals stand behind a stroke."""
    if verdict is None:
        return "none: it ended in an error"
    said = ", ".join(" / ".join(each) for each in names)
    return f"{verdict}: {said}" if said else verdict
