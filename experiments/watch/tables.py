"""The tables of the page, by the numbers of `results.json`."""

from experiments.tables import table

_DETECTORS = ("watch", "fixed threshold", "fuzzy rule")


def tables(results: dict) -> dict[str, str]:
    """False alarms, and what each detector finds."""
    made = {"false alarms": _false_alarms(results), "detection": _detection(results)}
    if "speed" in results:
        made["speed"] = _speed(results["speed"])
    return made


def _false_alarms(results: dict) -> str:
    rows = [
        (name, f"{one['stated_per_hour']:g}", f"{one['expected']:.0f}", one["counted"], f"{one['ratio']:.2f}")
        for name, found in results["false_alarms"].items()
        for one in found
    ]
    return table(("disturbance", "stated, per hour", "expected", "counted", "ratio"), rows)


def _detection(results: dict) -> str:
    found = results["detection"]
    rows = [
        (watch["fault"], *(_said(found[name][i]) for name in _DETECTORS if name in found))
        for i, watch in enumerate(found["watch"])
    ]
    return table(("fault", *(name for name in _DETECTORS if name in found)), rows)


def _said(one: dict) -> str:
    """Detected, right place, alone or among those that cannot be told apart, and median delay of a fault's runs."""
    delay = "never" if one["delay_median"] is None else f"{one['delay_median']:.0f} s"
    more = f" or {one['right_among']}" if one["right_among"] > one["right_place"] else ""
    return f"{one['detected']} of {one['runs']}, place {one['right_place']}{more}, {delay}"


def _speed(speed: dict) -> str:
    grown = f"{speed['memory_growth_kB'] / 1024:.0f} MB"
    row = (speed["samples"], f"{speed['median_ms']:.2f}", f"{100.0 * speed['share_over_2_ms']:.2g} %", grown)
    return table(("samples", "median, ms", "over 2 ms", "memory growth"), [row])
