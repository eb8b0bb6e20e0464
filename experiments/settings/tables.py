"""The tables of this experiment's page: one for each section of `settings.py`."""

from typing import Any

from ..tables import table
from .trials import described

_HEADER = ("setting", "value", "recovery, ×0.5", "×2", "false alarms, ×0.5", "×2", "other answers, ×0.5", "×2")


def tables(results: dict[str, Any]) -> dict[str, str]:
    """Settings as they are, and each setting halved and doubled; a dash where that was not measured."""
    usual = results["as it is"]
    row = [f"{usual['cases']}", _rate(usual["recovery"]), _rate(usual["false_alarms"]), f"{usual['cpu_seconds']:.0f}"]
    found = {"as it is": table(["cases", "recovery", "false alarms", "CPU seconds"], [row])}
    sections: dict[str, list[list[str]]] = {}
    for name, about in described().items():
        sections.setdefault(about["section"], []).append(_row(name, results["settings"].get(name)))
    return found | {section: table(_HEADER, rows) for section, rows in sections.items()}


def _row(name: str, measured: dict[str, Any] | None) -> list[str]:
    if measured is None:
        return [f"`{name}`", *["–"] * (len(_HEADER) - 1)]
    half, double = measured["found"]["x0.5"], measured["found"]["x2"]
    rates = [_rate(one[what]) for what in ("recovery", "false_alarms") for one in (half, double)]
    return [f"`{name}`", _value(measured["value"]), *rates, f"{len(half['other'])}", f"{len(double['other'])}"]


def _rate(rate: dict[str, Any]) -> str:
    return f"{round(rate['rate'] * rate['n'])} of {rate['n']}" if rate["n"] else "–"


def _value(value: float | list[float]) -> str:
    return ", ".join(f"{one:.3g}" for one in value) if isinstance(value, list) else f"{value:g}"
