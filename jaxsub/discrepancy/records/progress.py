"""How a long diagnosis says what it is doing, and ends when its time is spent."""

import math
import time
from collections.abc import Callable

Progress = Callable[[str], None]


class OutOfTime(Exception):
    """The diagnosis is to end with the answer so far: its time budget is spent, or it is told to stop."""


def limited(progress: Progress, budget: float | None, stop: Callable[[], bool]) -> Progress:
    """`progress` that raises `OutOfTime` at the first step which begins more than `budget` seconds from now, or once
    `stop()` is true.
    """
    end = time.monotonic() + (math.inf if budget is None else budget)

    def step(message: str) -> None:
        if time.monotonic() > end or stop():
            raise OutOfTime
        progress(message)

    return step
