"""From a line a case to `results.json`."""

from collections import Counter
from collections.abc import Callable, Sequence

from . import scoring
from .plan import CONDITIONS
from .truths import TRUTHS

Lines = Sequence[dict]
# rows of the table: the conditions in each, and the shares that count as met, of right answers and of first places
TABLE = {
    "one effect ≥ 3σ, white noise": (("strong",), 0.99, 0.99),
    "one effect of 1 to 3σ": (("weak",), 0.95, 0.95),
    "no velocity log, ≥ 3σ": (("no_velocity",), 0.95, 0.95),
    "coloured disturbance of 3σ, effect ≥ 3σ": (("coloured",), 0.95, 0.90),
    "sigma misstated by ×0.5 or ×2": (("sigma",), 0.95, 0.95),
    "σ of every channel unknown": (("estimated",), 0.95, None),
    "outliers or a sensor that drops out": (("outliers", "dropout"), 0.95, None),
    "noise that varies, or quantised sensors": (("varying_noise", "quantised"), 0.95, None),
    "sensors at 1 Hz, or half of the samples lost": (("slow", "uneven"), 0.95, None),
    "closed loop under an autopilot": (("closed_loop",), 0.95, None),
    "a nonlinear baseline": (("nonlinear",), 0.95, None),
    "two effects of ≥ 3σ": (("pair",), 0.95, None),
    "three effects of ≥ 3σ": (("triple",), 0.85, None),
    "ten effects of ≥ 3σ": (("ten",), None, None),
    "an effect outside the vocabulary": (("outside",), 0.95, 0.90),
    "nothing concealed": (tuple(name for name, of in CONDITIONS.items() if not of.effects), 0.98, None),
}
_ALL = list(TABLE)
# as the page divides them
SEVERAL = "several effects, or another"
GROUPS = {
    "one effect": _ALL[:5], "recorded as logs are": _ALL[5:11], SEVERAL: _ALL[11:15], "nothing concealed": _ALL[15:],
}  # fmt: skip
SIZE = (
    "rms over the training runs of what the effect leaves on its most affected channel, in true sigmas of that "
    "channel, after projection off the tangents of the free coefficients and initial states at the true vehicle"
)
_SETS = {"fresh": True, "practised": False}
_SINGLE = ("strong", "weak", "faint")


def is_right(line: dict, answer: dict) -> bool:
    """Whether `answer` is right of the case of `line`, by the rule for as many effects as it conceals."""
    names = line["truth"]["names"]
    if len(names) > scoring.FEW:
        return scoring.right_of_many(names, answer, line["truth"]["floor"])
    return scoring.right(names, answer)


def conditions(lines: Lines, answer: Callable[[dict], dict | None]) -> list[dict]:
    """The issue's table for one answerer; a case that failed counts as wrong."""
    rows = []
    for condition, (parts, target, target_place) in TABLE.items():
        chosen = [(line, answer(line)) for line in lines if line["condition"] in parts]
        answered = [(line, found) for line, found in chosen if found is not None]
        scored = scoring.rate(is_right(line, found) for line, found in answered)
        row = {"condition": condition, "right": scored, "n": len(answered), "target": target}
        row["met"] = None if target is None else scored["rate"] is not None and scored["rate"] >= target
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
    """What `assemble` makes of fresh cases and of those on which engines were corrected."""
    chosen = {name: [line for line in every if line["fresh"] == fresh] for name, fresh in _SETS.items()}
    return {name: assemble(lines) for name, lines in chosen.items() if lines}


def assemble(every: Lines) -> dict:
    """All rates of the README, of the cases that could be made."""
    lines = [line for line in every if "answer" in line]
    ours = lambda line: line["answer"]
    named = [line for line in lines if line["truth"]["names"]]
    clean = {c: [x for x in lines if x["condition"] == c] for c, of in CONDITIONS.items() if not of.effects}
    pairs = [pair for line in lines for pair in scoring.forecasts(line["truth"]["names"], line["answer"])]
    held = {line["case"]: scoring.held_out(line["answer"], line["truth"]["floor"]) for line in lines}
    held = {case: gains for case, gains in held.items() if gains is not None}
    concealed = [held[line["case"]] for line in named if line["case"] in held and is_right(line, line["answer"])]
    hits = [hit for x in lines for hit in scoring.covered(x["truth"]["numbers"], x["truth"]["names"], x["answer"])]
    families = lambda line: [TRUTHS[key].family for key in line["concealed"]]
    judged = [line for line in lines if "kinds" in line["answer"] and line["condition"] != "outside"]
    short = [x for x in lines if x["condition"] == "short"]
    lengths = {s: [x for x in short if x["way"]["seconds"] == s] for s in (40.0, 80.0)}
    many = [x for x in lines if len(x["truth"]["names"]) > scoring.FEW]
    return {
        "size": SIZE,
        "engines": dict(Counter(line["engine"]["commit"] for line in every)),
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
        "clean": {k: scoring.rate(is_right(x, ours(x)) for x in c) for k, c in clean.items()},
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
            "within_10_percent": scoring.rate(gains["after"] <= 1.1 for gains in concealed),
            "cases": held,
        },
        "many": [scoring.counted(x["truth"]["names"], ours(x)) | {"case": x["case"]} for x in many],
        "seconds": _times(lines, "seconds"),
        "cpu_seconds": _times(lines, "cpu_seconds"),
        "conditions": conditions(lines, ours),
        "peers": {peer: _peer(lines, peer) for peer in ("pysindy", "stepwise_aic", "stepwise_bic")},
        "right": scoring.rate(is_right(x, ours(x)) for x in lines),
        "cases": [_said(line) for line in lines],
        "failed": [{"case": x["case"], "error": x["answer"]["error"]} for x in lines if "error" in x["answer"]],
        "not_made": [{"case": x["case"], "truth": x["concealed"], "why": x["why"]} for x in every if "answer" not in x],
    }  # fmt: skip


def _times(lines: Lines, kind: str) -> dict[str, float]:
    """Median and largest time of an answer, s, and their sum."""
    found = sorted(line["answer"][kind] for line in lines if kind in line["answer"])
    return {"median": found[len(found) // 2], "largest": found[-1], "sum": sum(found)} if found else {}


def _said(line: dict) -> dict:
    """What was concealed in a case, what was said of it, and how long that took."""
    answer = line["answer"]
    names = [scoring.offered(entry, answer["verdict"]) for entry in answer.get("physics", [])]
    judged = {"verdict": answer.get("verdict"), "names": names, "right": is_right(line, answer)}
    judged |= {"wrong": None if judged["right"] else scoring.how_wrong(line["truth"]["names"], answer)}
    judged |= {kind: round(answer[kind], 1) for kind in ("seconds", "cpu_seconds") if kind in answer}
    return {"case": line["case"], "concealed": line["concealed"], "size": line["size"]} | judged


def _peer(lines: Lines, peer: str) -> dict:
    answer = lambda line: line.get("peers", {}).get(peer)
    return {"conditions": conditions(lines, answer), "recovery": recovery(lines, answer)}
