"""The tables of this experiment's page."""

from typing import Any

from ..tables import table


def tables(results: dict[str, Any]) -> dict[str, str]:
    """False alarms by vehicle and sensors, and the share of runs in which a fault is named, by its size."""
    cells = results["clean"]["cells"]
    sensors = list(dict.fromkeys(cell["sensors"] for cell in cells))
    alarms = {(cell["vehicle"], cell["sensors"]): f"{cell['alarms']} of {cell['runs']}" for cell in cells}
    vehicles = dict.fromkeys(cell["vehicle"] for cell in cells)
    words = ("late", "factor", "reversed")
    whole = {name: found for name, found in results["detection"].items() if any(word in name for word in words)}
    others = {name: found for name, found in results["detection"].items() if name not in whole}
    return {
        "false alarms": table(["vehicle", *sensors], [[v, *(alarms[v, s] for s in sensors)] for v in vehicles]),
        "delays, factors and signs": _detection(whole),
        "other faults": _detection(others),
    }


def _detection(found: dict[str, Any]) -> str:
    rows = [
        [
            f"{name} ({of['unit']})" if of["unit"] else name,
            _shares(of["sizes"], of["named"]),
            _shares(of["sizes"], of["called_something_else"]) if any(of["called_something_else"]) else "never",
        ]
        for name, of in found.items()
    ]
    return table(["fault (unit of its size)", "named, by size", "named as another fault"], rows)


def _shares(sizes: list[float], shares: list[float]) -> str:
    return ", ".join(f"{size:.4g}: {share:.0%}".replace("%", " %") for size, share in zip(sizes, shares, strict=True))
