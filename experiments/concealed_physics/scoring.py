"""What counts as right, from a line that holds a case's truth and an answer to it."""

import itertools
import math
from collections.abc import Iterable, Sequence

from jaxsub.estimate import Rate

MOST_RIVALS = 4
# effects at once up to which each has to be named, and of more the share of the mismatch that has to be explained
FEW, MOST = 3, 0.75
# what kind of thing is wrong where an effect of a family is missing; of any other family, the vehicle's structure
KINDS = {"actuators": "actuator", "sensors": "sensor", "environment": "environment"}
EDGES = (0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 0.97, 1.0)


def rate(hits: Iterable[bool]) -> dict:
    """A share with its 95 % interval by Wilson; None where there were no trials."""
    hits = list(hits)
    if not hits:
        return {"rate": None, "n": 0, "interval": None}
    found = Rate(sum(hits), len(hits))
    return {"rate": found.share, "n": found.count, "interval": list(found.interval)}


def offered(entry: dict, verdict: str) -> list[str]:
    """The names that an accepted entry puts forward: its own and, where the answer is `ambiguous`, its rivals'."""
    if verdict != "ambiguous":
        return [entry["effect"]]
    return list(dict.fromkeys([entry["effect"], *(name for name, _ in entry["rivals"])]))


def right(names: Sequence[str], answer: dict) -> bool:
    """Whether `answer` names all of `names` and nothing else, or puts each among at most four rivals.

    With nothing concealed the right answer is `none`; for what the vocabulary lacks it is `unknown`.
    """
    verdict = answer.get("verdict")
    if not names:
        return verdict == "none"
    if any(name.startswith("outside") for name in names):
        return verdict == "unknown"
    if verdict not in ("named", "ambiguous"):
        return False
    sets = [offered(entry, verdict) for entry in answer["physics"]]
    # forms of one effect count once
    distinct = {tuple(sorted(s)) for s in sets}
    return len(distinct) == len(set(names)) and _matched(list(dict.fromkeys(names)), list(distinct))


def right_of_many(names: Sequence[str], answer: dict, floor: dict) -> bool:
    """Whether every accepted effect of `answer` is among the many `names`, and most of the mismatch is explained.

    Where effects are ten, not each has to be named. One at least is, none is false, and the improved model removes
    `MOST` of the test run's squared error above the noise `floor` of each channel. A peer simulates no improved model,
    and is judged by its names alone.
    """
    if answer.get("verdict") not in ("named", "ambiguous"):
        return False
    sets = list({tuple(sorted(offered(entry, answer["verdict"]))) for entry in answer["physics"]})
    true = [s for s in sets if len(s) <= MOST_RIVALS and set(s) & set(names)]
    share = explained(answer, floor)
    return 0 < len(true) == len(sets) and (share is None or share >= MOST)


def counted(names: Sequence[str], answer: dict) -> dict:
    """How many of `names` the answer puts forward, and how many of its entries put forward none of them."""
    sets = [offered(entry, answer["verdict"]) for entry in answer.get("physics", [])]
    seen = {name for offers in sets for name in offers}
    return {"true": len(set(names) & seen), "of": len(set(names)), "false": sum(not set(s) & set(names) for s in sets)}


def how_wrong(names: Sequence[str], answer: dict) -> str:
    """What kind of wrong a wrong answer is."""
    if "error" in answer:
        return "an error"
    if not answer.get("physics"):
        return f"`{answer['verdict']}`"
    found = counted(names, answer)
    if found["false"]:
        return "a false name" if found["true"] < found["of"] else "a false name beside the true ones"
    return "some of several named" if found["true"] < found["of"] else "as more entries, or too little explained"


def explained(answer: dict, floor: dict) -> float | None:
    """The share of the test run's squared error above the noise that the improved model removes."""
    errors = held_out(answer, floor)
    if errors is None:
        return None
    before, after = errors["before"] ** 2, errors["after"] ** 2
    return (before - after) / max(before - 1.0, 1e-12)


def false_alarm(answer: dict) -> bool:
    """Whether an answer to a case with nothing concealed names physics, which is not there.

    `unknown` names none: it says that a test run's error is larger than its noise, as coloured noise can make it. It is
    not `right` there either, so that the two rates need not add up to one.
    """
    return answer.get("verdict") in ("named", "ambiguous")


def _matched(names: list[str], sets: list[tuple[str, ...]]) -> bool:
    """Whether every name has an entry of its own that puts it forward, in some order."""
    if not names:
        return True
    fits = [i for i, s in enumerate(sets) if names[0] in s and len(s) <= MOST_RIVALS]
    return any(_matched(names[1:], sets[:i] + sets[i + 1 :]) for i in fits)


def among(names: Sequence[str], answer: dict) -> bool:
    """Whether every name is put forward by some entry, whatever else is."""
    if answer.get("verdict") not in ("named", "ambiguous"):
        return False
    seen = {name for entry in answer["physics"] for name in offered(entry, answer["verdict"])}
    return set(names) <= seen


def first_place(places: Sequence[Sequence[str]], answer: dict) -> bool:
    """Whether the first place that the answer gives is one where any concealed effect acts."""
    where = answer.get("where") or []
    return bool(where) and any(where[0] in listed for listed in places)


def first_kind(families: Sequence[str], answer: dict) -> bool:
    """Whether the kind of mismatch that the answer holds most probable is that of any concealed effect's family.

    With nothing concealed it is disturbance forces and noise.
    """
    true = {KINDS.get(family, "structure") for family in families} or {"disturbance"}
    kinds = answer.get("kinds") or {}
    return bool(kinds) and max(kinds, key=lambda kind: kinds[kind]) in true


def forecasts(names: Sequence[str], answer: dict) -> list[tuple[float, bool]]:
    """Every (stated probability, whether it is true) of an answer: of entries, and of their rivals."""
    found = []
    for entry in answer.get("physics", []):
        if entry["probability"] is not None:
            named = dict(entry["rivals"]) | {entry["effect"]: entry["probability"]}
            found += [(probability, name in names) for name, probability in named.items()]
    return found


def calibration(pairs: Sequence[tuple[float, bool]]) -> list[dict]:
    """Mean stated probability beside the observed share, by bin."""
    bins = []
    for low, high in itertools.pairwise(EDGES):
        inside = [(p, hit) for p, hit in pairs if low <= p < high or (high == 1.0 and p >= high)]
        if inside:
            stated = sum(p for p, _ in inside) / len(inside)
            bins.append({"stated": stated, **rate(hit for _, hit in inside)})
    return bins


def covered(numbers: Sequence[dict], names: Sequence[str], answer: dict) -> list[bool]:
    """For each true number that a rightly named entry estimates: whether its 95 % interval holds it."""
    found = []
    for name, true in zip(names, numbers, strict=True):
        for entry in answer.get("physics", []):
            if entry["effect"] == name:
                shared = [symbol for symbol in true if symbol in entry["parameters"]]
                for symbol in shared:
                    value, error = entry["parameters"][symbol]
                    found.append(abs(value - true[symbol]) <= 1.96 * error)
    return found


def held_out(answer: dict, floor: dict) -> dict | None:
    """Errors on the test run before and after, in units of those of the true model: rms over channels of rms/`floor`.

    So noise whose sigma is stated wrongly, or estimated from what a model leaves, counts as any other.
    """
    errors = answer.get("held_out_rms")
    if not errors or not floor:
        return None
    overall = lambda by: math.sqrt(sum((by[c] / floor[c]) ** 2 for c in floor) / len(floor))
    return {"before": overall(errors["baseline"]), "after": overall(errors["improved"])}
