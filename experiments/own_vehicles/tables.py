"""The tables of this experiment's page."""

from typing import Any

from jaxsub.estimate import Rate

from ..tables import table

_ROWS = 8
_HEADER = ("vehicle", "concealed", "answer", "", "test error, σ", "s")


def tables(results: dict[str, Any]) -> dict[str, str]:
    """What was concealed in each vehicle and what was answered, in parts of at most eight cases; how many are right."""
    rows = [_row(line) for line in results["cases"]]
    starts = range(0, len(rows), _ROWS)
    made = {f"answers, part {n}": table(_HEADER, rows[at : at + _ROWS]) for n, at in enumerate(starts, 1)}
    return made | {"counts": table(["of all cases", "", "95 % interval"], _counts(results["cases"]))}


def _counts(cases: list[dict[str, Any]]) -> list[list[str]]:
    """Right answers, and false alarms where nothing is concealed."""
    clean = [line for line in cases if line["concealed"] == "nothing"]
    named = sum(line["answer"].get("verdict") != "none" for line in clean)
    rates = {
        "right answers": Rate(sum(line["mark"] == "right" for line in cases), len(cases)),
        "false alarms where nothing is concealed": Rate(named, len(clean)),
    }
    return [
        [words, f"{rate.successes} of {rate.count}", "–".join(f"{100.0 * end:.0f}" for end in rate.interval) + " %"]
        for words, rate in rates.items()
    ]


def _row(line: dict[str, Any]) -> list[str]:
    answer = line["answer"]
    if "error" in answer:
        return [line["vehicle"], line["concealed"], "none: it ended", line["mark"], "–", "–"]
    names = ", ".join(_entry(entry) for entry in answer["physics"])
    held = answer["held_out"]
    errors = [f"{max(held[model].values()):.3g}" for model in ("baseline", "improved")]
    said = f"`{answer['verdict']}`{': ' + names if names else ''}"
    return [line["vehicle"], line["concealed"], said, line["mark"], " → ".join(errors), f"{answer['seconds']:.0f}"]


def _entry(entry: dict[str, Any]) -> str:
    """The name of an effect with its rivals', or with its number where it has one and no rivals."""
    rivals = "".join(f" or `{name}`" for name, _ in entry["rivals"])
    sizes = [f"{symbol} = {value:.3g} ± {error:.1g}" for symbol, (value, error) in entry["parameters"].items()]
    return f"`{entry['effect']}`{rivals}" + (f" ({sizes[0]})" if len(sizes) == 1 and not rivals else "")
