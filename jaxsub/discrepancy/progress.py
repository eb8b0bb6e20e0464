"""How a long diagnosis says what it is doing, and ends when its time is spent."""

import math
import time
from collections.abc import Callable

Progress = Callable[[str], None]


class OutOfTime(Exception):
    """The time budget of a diagnosis is spent."""


def limited(progress: Progress, budget: float | None) -> Progress:
    """`progress` that raises `OutOfTime` at the first step which begins more than `budget` seconds from now."""
    end = time.monotonic() + (math.inf if budget is None else budget)

    def step(message: str) -> None:
        if time.monotonic() > end:
            raise OutOfTime
        progress(message)

    return step
