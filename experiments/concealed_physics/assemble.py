"""From a line a case to `results.json`."""

from collections import Counter
from collections.abc import Callable, Sequence

from . import scoring
from .truths import TRUTHS

Lines = Sequence[dict]
# condition of the table: the rows of the plan in it, and the shares that count as met
TABLE = {
    "one effect ≥ 3σ, white noise": (("strong",), 0.99, 0.99),
    "one effect of 1 to 3σ": (("weak",), 0.90, 0.95),
    "no velocity log, ≥ 3σ": (("no_velocity",), 0.90, 0.95),
    "coloured disturbance of 3σ, effect ≥ 3σ": (("coloured",), 0.90, 0.90),
    "sigma misstated by ×0.5 or ×2": (("sigma",), 0.95, 0.95),
    "two effects of ≥ 3σ": (("pair",), 0.90, None),
    "three effects of ≥ 3σ": (("triple",), 0.75, None),
    "an effect outside the vocabulary": (("outside",), 0.90, 0.90),
    "σ of every channel unknown": (("estimated",), 0.95, None),
    "outliers or a sensor that drops out": (("outliers", "dropout"), 0.95, None),
    "noise that varies, or quantised sensors": (("varying_noise", "quantised"), 0.95, None),
    "sensors at 1 Hz, or half of the samples lost": (("slow", "uneven"), 0.95, None),
    "nothing concealed": (("none_white", "none_coloured", "none_half", "none_double"), 0.97, None),
}
SIZE = (
    "rms over the training runs of what the effect leaves on its most affected channel, in true sigmas of that "
    "channel, after projection off the tangents of the free coefficients and initial states at the true vehicle"
)
_SETS = {"fresh": True, "practised": False}
_SINGLE = ("strong", "weak", "faint")


def is_right(line: dict, answer: dict) -> bool:
    return scoring.right(line["truth"]["names"], answer)


def conditions(lines: Lines, answer: Callable[[dict], dict | None]) -> list[dict]:
    """The issue's table for one answerer; a case that failed counts as wrong."""
    rows = []
    for condition, (parts, target, target_place) in TABLE.items():
        chosen = [(line, answer(line)) for line in lines if line["condition"] in parts]
        answered = [(line, found) for line, found in chosen if found is not None]
        scored = scoring.rate(is_right(line, found) for line, found in answered)
        row = {"condition": condition, "right": scored, "n": len(answered), "target": target}
        row["met"] = scored["rate"] is not None and scored["rate"] >= target
        if target_place is not None:
            for kind, strict in (("first_equation", "where"), ("first_equation_lenient", "lenient")):
                row[kind] = scoring.rate(scoring.first_place(x["truth"][strict], found) for x, found in answered)
            row["target_first_equation"] = target_place
            place = row["first_equation"]["rate"]
            row["met_first_equation"] = place is not None and place >= target_place
        rows.append(row)
    return rows


def recovery(lines: Lines, answer: Callable[[dict], dict | None]) -> dict:
    """By effect and size under white noise with every channel: right, and the share answered `ambiguous` rightly."""
    table: dict[str, dict[str, list]] = {}
    for line in lines:
        found = answer(line)
        if line["condition"] in _SINGLE and found is not None:
            sizes = table.setdefault(line["truth"]["names"][0], {})
            sizes.setdefault(f"{line['size']:g}", []).append((is_right(line, found), found.get("verdict")))
    return {
        name: {
            size: scoring.rate(hit for hit, _ in hits)
            | {"ambiguous": sum(hit and verdict == "ambiguous" for hit, verdict in hits) / len(hits)}
            for size, hits in sorted(sizes.items(), key=lambda item: float(item[0]))
        }
        for name, sizes in sorted(table.items())
    }


def sets(every: Lines) -> dict[str, dict]:
    """What `assemble` makes of fresh cases and of those on which engines were corrected, of each engine by itself."""
    engines = list(dict.fromkeys(line["engine"] for line in every))
    found = {}
    for name, fresh in _SETS.items():
        for number, engine in enumerate(engines, 1):
            lines = [line for line in every if line["fresh"] == fresh and line["engine"] == engine]
            label = name if len(engines) == 1 else f"{name}, engine {number}"
            found |= {label: assemble(lines)} if lines else {}
    return found


def assemble(every: Lines) -> dict:
    """All rates of the README, of the cases that could be made."""
    lines = [line for line in every if "answer" in line]
    ours = lambda line: line["answer"]
    named = [line for line in lines if line["truth"]["names"]]
    clean = {kind: [x for x in lines if x["condition"] == f"none_{kind}"] for kind in
             ("white", "coloured", "half", "double")}  # fmt: skip
    pairs = [pair for line in lines for pair in scoring.forecasts(line["truth"]["names"], line["answer"])]
    held = {line["case"]: scoring.held_out(line["answer"], line["truth"]["floor"]) for line in lines}
    held = {case: gains for case, gains in held.items() if gains is not None}
    concealed = [held[line["case"]] for line in named if line["case"] in held and is_right(line, line["answer"])]
    hits = [hit for x in lines for hit in scoring.covered(x["truth"]["numbers"], x["truth"]["names"], x["answer"])]
    families = lambda line: [TRUTHS[key].family for key in line["concealed"]]
    judged = [line for line in lines if "kinds" in line["answer"] and line["condition"] != "outside"]
    lengths = {s: [x for x in lines if x["seconds"] == s and x["condition"] in ("short",)] for s in (40.0, 80.0)}
    seconds = sorted(line["answer"]["seconds"] for line in lines if "seconds" in line["answer"])
    return {
        "size": SIZE,
        "engines": dict(Counter(line["engine"] for line in every)),
        "recovery": recovery(lines, ours),
        "recovery_by_length": {f"{s:g} s": scoring.rate(is_right(x, ours(x)) for x in at) for s, at in lengths.items()},
        "located": {
            kind: scoring.rate(scoring.first_place(x["truth"][key], ours(x)) for x in named)
            for kind, key in (("strict", "where"), ("lenient", "lenient"))
        },
        "kind": {
            c: scoring.rate(scoring.first_kind(families(x), ours(x)) for x in judged if x["condition"] == c)
            for c in dict.fromkeys(x["condition"] for x in judged)
        },
        "false_alarm": {k: scoring.rate(scoring.false_alarm(ours(x)) for x in c) for k, c in clean.items()},
        "false_alarms": scoring.rate(scoring.false_alarm(ours(x)) for x in lines if not x["concealed"]),
        "unknown_recall": scoring.rate(is_right(x, ours(x)) for x in lines if x["condition"] == "outside"),
        "all_named_with_extras": {
            c: scoring.rate(scoring.among(x["truth"]["names"], ours(x)) for x in lines if x["condition"] == c)
            for c in ("strong", "weak", "pair", "triple")
        },
        "calibration": scoring.calibration(pairs),
        "coverage": scoring.rate(hits),
        "held_out": {
            "within_10_percent": scoring.rate(gains["after"] <= 1.1 * gains["floor"] for gains in concealed),
            "cases": held,
        },
        "seconds": {"median": seconds[len(seconds) // 2], "largest": seconds[-1]} if seconds else {},
        "conditions": conditions(lines, ours),
        "peers": {peer: _peer(lines, peer) for peer in ("pysindy", "stepwise_aic", "stepwise_bic")},
        "right": scoring.rate(is_right(x, ours(x)) for x in lines),
        "cases": [_said(line) for line in lines],
        "failed": [{"case": x["case"], "error": x["answer"]["error"]} for x in lines if "error" in x["answer"]],
        "not_made": [{"case": x["case"], "truth": x["concealed"], "why": x["why"]} for x in every if "answer" not in x],
    }  # fmt: skip


def _said(line: dict) -> dict:
    """What was concealed in a case, and what was said of it."""
    answer = line["answer"]
    names = [scoring.offered(entry, answer["verdict"]) for entry in answer.get("physics", [])]
    judged = {"verdict": answer.get("verdict"), "names": names, "right": is_right(line, answer)}
    return {"case": line["case"], "concealed": line["concealed"], "size": line["size"]} | judged


def _peer(lines: Lines, peer: str) -> dict:
    answer = lambda line: line.get("peers", {}).get(peer)
    return {"conditions": conditions(lines, answer), "recovery": recovery(lines, answer)}
