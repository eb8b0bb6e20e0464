"""The tables of this experiment's page."""

from typing import Any

from ..tables import table

_ROWS = 8
_HEADER = ("vehicle", "concealed", "answer", "", "test error, σ", "s")


def tables(results: dict[str, Any]) -> dict[str, str]:
    """What was concealed in each vehicle and what was answered, in parts of at most eight cases."""
    rows = [_row(line) for line in results["cases"]]
    starts = range(0, len(rows), _ROWS)
    return {f"answers, part {n}": table(_HEADER, rows[at : at + _ROWS]) for n, at in enumerate(starts, 1)}


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
