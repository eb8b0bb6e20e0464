"""Threads that share a compiled step, each with a packed state of its own, get what a caller alone gets."""

import shutil
import threading
from concurrent.futures import ThreadPoolExecutor

import jax
import numpy as np
import pytest
from stream_cases import at, attitude_stream, gentle_readings, started

from jaxsub.navigation.compiled_step import ahead_of_time, native

C = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
WAYS = {"xla": ahead_of_time, "c": lambda stream, *like: native(stream.step, *like)}
THREADS, ROUNDS = 4, {"xla": 3, "c": 25}


@pytest.mark.parametrize("way", ["xla", pytest.param("c", marks=[C, pytest.mark.long])])
def test_estimates_of_threads_are_those_of_one(way):
    stream = attitude_stream()
    records = [jax.tree.map(np.asarray, gentle_readings(seed=seed)) for seed in range(THREADS)]
    state = started(stream, gentle_readings())
    program = WAYS[way](stream, state, at(gentle_readings(), 0))

    def flown(record):
        packed, found = program.pack(state), []
        for k in range(40):
            packed, estimate = program.step(packed, at(record, k))
            found.append(np.concatenate([np.ravel(estimate.x), np.ravel(estimate.innovation)]))
        return np.array(found)

    expected, begin = [flown(record) for record in records], threading.Barrier(THREADS)

    def again(number):
        begin.wait()
        return [flown(records[number]) for _ in range(ROUNDS[way])]

    with ThreadPoolExecutor(THREADS) as pool:
        for answers, wanted in zip(pool.map(again, range(THREADS)), expected, strict=True):
            for found in answers:
                np.testing.assert_array_equal(found, wanted)
