"""The verdict in sentences, with what the test runs say of it."""

from collections.abc import Sequence

from ...effects import AbstractEffect, RunVariation, SmoothForce
from .. import settings
from ..records.diagnosis import Explained, Location, Physics, Rival, Verdict
from .consistency import sigmas


def summary(
    verdict: Verdict,
    physics: Sequence[Physics],
    where: Sequence[Location],
    standing: Sequence[AbstractEffect],
    found: Explained | None,
    p_value: float,
) -> str:
    """The verdict, what is `explained` and left of the test runs' error, and surrogate effects.

    None of an answer on the way, before the test runs are looked at.
    """
    forces = [effect for effect in standing if isinstance(effect, SmoothForce)]
    described = [effect.label for effect in standing if effect not in forces]
    described += [f"a smooth force in {force.equation}" for force in forces]
    added = f" Surrogates for unknown physics, which claim no cause: {', '.join(described)}." if described else ""
    sentences = [_verdict(verdict, physics, where, found, p_value) + added]
    if found is None:
        sentences.append("The test runs were not looked at yet.")
    elif physics or standing:
        sentences.append(explained_sentence(found))
    elif verdict == "unknown":
        sentences.append(_test_error(found))
    return " ".join(sentences)


def explained_sentence(found: Explained) -> str:
    """What the improved model removes of the test runs' excess variance, and what it leaves."""
    if not (found.baseline_runs and found.improved_runs):
        return _test_error(found)
    if found.share is None:
        return f"On the test run the baseline's simulation error is within its noise too. {_test_error(found)}"
    if found.share <= 0.0:
        return f"The improved model does not reduce the simulation error on the test run. {_test_error(found)}"
    left = [f"{channel} is left at {value:.3g} σ" for channel, value in found.left.items()]
    return (
        f"The improved model removes {_percent(found.share)} of the test run's excess variance; "
        f"{', '.join(left) or 'no channel is left above its noise'}."
    )


def _verdict(
    verdict: Verdict, physics: Sequence[Physics], where: Sequence[Location], found: Explained | None, p_value: float
) -> str:
    places = " and ".join(place.where for place in where[:2]) or "no equation"
    names = ", then ".join(map(_named, physics))
    if verdict == "none":
        return _nothing(found, p_value)
    if verdict == "named":
        return f"The model lacks {names}, which acts in {places}."
    if verdict == "ambiguous":
        rivals = sorted({_named(rival) for one in physics for rival in one.rivals})
        unlike = f", but these runs do not separate it from {', '.join(rivals)}"
        others = unlike if rivals else ", but not with certainty"
        return f"Something is missing in {places}: {names}{others}."
    if not where:
        return "The recordings are not explained, and no missing effect is significant in any equation."
    return f"Something is missing in {places}, and nothing in the vocabulary explains it."


def _named(one: Physics | Rival) -> str:
    """The effect; of a number that differs by run also which."""
    return one.label if one.effect == RunVariation.name else one.effect


def _nothing(found: Explained | None, p_value: float) -> str:
    why_none = "is significant" if p_value >= settings.SIGNIFICANCE else "holds on the test run"
    start = f"No missing effect {why_none}"
    if found is None:
        return f"{start}."
    if not found.left:
        return f"{start}: the model explains the recordings, and the test run to its noise."
    large = {channel: value for channel, value in found.random.items() if found.left[channel] > settings.LARGE_ERROR}
    why = f"; noise and random disturbance forces leave {sigmas(large)}" if large else ""
    return f"{start}, but the simulation error on the test run is more than its noise: {sigmas(found.left)}{why}."


def _test_error(found: Explained) -> str:
    """How the last model simulates the test runs."""
    if not found.improved_runs:
        return "The model diverges on the test run."
    start = "" if found.baseline_runs else "The baseline diverges on the test run. "
    size = f"is {sigmas(found.left)}" if found.left else "is no more than its noise"
    return f"{start}Simulation error on the test run {size}."


def _percent(share: float) -> str:
    """In whole percent, and all only where nothing is left."""
    if share >= 1.0:
        return "all"
    return "more than 99 %" if share > 0.995 else "less than 1 %" if share < 0.005 else f"{100.0 * share:.0f} %"
