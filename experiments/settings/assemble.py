"""From a line a trial to `results.json`."""

from collections.abc import Sequence

from jaxsub.discrepancy import settings

from ..concealed_physics import scoring
from .trials import FACTORS, described, scaled

Lines = Sequence[dict]


def assemble(lines: Lines) -> dict:
    """What each setting's halves and doubles do to recovery and false alarms, of trials by one engine."""
    done = [line for line in lines if "answer" in line]
    of = lambda name, factor: [line for line in done if (line["setting"], line["factor"]) == (name, factor)]
    usual = {line["judged"]: said(line["answer"]) for line in of("", 1.0)}
    found = {}
    for name, about in described().items():
        value = getattr(settings, name)
        by_factor = {f"x{factor:g}": _rates(of(name, factor), usual) for factor in FACTORS}
        values = {f"x{factor:g}": scaled(value, factor) for factor in FACTORS}
        if any(rates["cases"] for rates in by_factor.values()):
            found[name] = about | {"value": value, "values": values, "found": by_factor}
    return {
        "engine": next((line["engine"] for line in done), None),
        "cases": list(dict.fromkeys(line["judged"] for line in done)),
        "as it is": _rates(of("", 1.0), usual),
        "settings": found,
    }


def said(answer: dict) -> list:
    """The verdict, and the effects with their rivals."""
    verdict = answer.get("verdict", "error")
    return [verdict, sorted(scoring.offered(entry, verdict) for entry in answer.get("physics", []))]


def _rates(lines: Lines, usual: dict[str, list]) -> dict:
    """Recovery of what was concealed, false alarms where nothing was, other answers than `usual`, and CPU seconds."""
    concealed = [line for line in lines if line["names"]]
    clean = [line for line in lines if not line["names"]]
    other = {line["judged"]: said(line["answer"]) for line in lines}
    return {
        "cases": len(lines),
        "recovery": scoring.rate(scoring.right(line["names"], line["answer"]) for line in concealed),
        "false_alarms": scoring.rate(scoring.false_alarm(line["answer"]) for line in clean),
        "other": {case: answer for case, answer in other.items() if case in usual and answer != usual[case]},
        "cpu_seconds": sum(line["answer"].get("cpu_seconds", 0.0) for line in lines),
    }
