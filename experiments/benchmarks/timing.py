"""How a call is timed: its first time apart, then repeats with their spread; on one core where peers are paired."""

import os
import time
from collections.abc import Callable
from typing import Any

import jax
import numpy as np
from threadpoolctl import threadpool_limits  # pyright: ignore[reportMissingImports]


def pin(cores: int) -> list[int]:
    """Keep this process, and the threads that it starts from now on, on so many of its cores; which.

    NumPy's linear algebra too, which else has as many threads as there are cores in all, and they wait for each other.
    """
    chosen = sorted(os.sched_getaffinity(0))[:cores]
    os.sched_setaffinity(0, chosen)
    threadpool_limits(cores)
    return chosen


def timed(call: Callable[[], Any], repeats: int) -> dict[str, float]:
    """Seconds of the first call, and of `repeats` more: median, least and most."""
    return in_turn({"it": call}, repeats)["it"]


def in_turn(calls: dict[str, Callable[[], Any]], repeats: int) -> dict[str, dict[str, float]]:
    """The same of several, one after the other in every round: what else the machine does meets all of them."""
    first = {name: once(call)[1] for name, call in calls.items()}
    spent = [{name: once(call)[1] for name, call in calls.items()} for _ in range(repeats)]
    return {name: {"first_s": first[name], **spread_of([row[name] for row in spent])} for name in calls}


def once(call: Callable[[], Any]) -> tuple[Any, float]:
    """What a call gives, and its seconds."""
    begin = time.perf_counter()
    found = jax.block_until_ready(call())
    return found, time.perf_counter() - begin


def a_member(row: dict[str, float], count: int) -> dict[str, float]:
    """A batch's seconds, but for those of its first call, as those of each of its `count` members."""
    return {name: seconds / count for name, seconds in row.items() if name != "first_s"}


def slope(sizes: list[int], values: list[float]) -> float:
    """Of log `values` over log `sizes`, by least squares."""
    return float(np.polyfit(np.log(sizes), np.log(values), 1)[0])


def spread_of(rows: list[float]) -> dict[str, float]:
    """Median, least and most of several runs' seconds."""
    return {"s": float(np.median(rows)), "least_s": min(rows), "most_s": max(rows)}
