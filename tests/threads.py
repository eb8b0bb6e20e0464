"""Calls from several threads against the same calls from one."""

import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np

THREADS = 4


def same_in_threads(call, arguments, rounds=1):
    """`call(*at)` in threads that begin together, each through all arguments from a place of its own, against alone."""
    expected, count = [call(*at) for at in arguments], len(arguments)
    begin = threading.Barrier(THREADS)

    def one(number):
        begin.wait()
        order = [(k + number * count // THREADS) % count for k in range(count)] * rounds
        return [(k, call(*arguments[k])) for k in order]

    with ThreadPoolExecutor(THREADS) as pool:
        for answers in pool.map(one, range(THREADS)):
            for k, found in answers:
                for a, b in zip(found, expected[k], strict=True):
                    np.testing.assert_array_equal(a, b)
