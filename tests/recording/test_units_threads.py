"""Threads that are the first to ask for units share one registry: units of two do not convert into each other."""

import subprocess
import sys

PROGRAM = """
import sys, threading
import numpy as np
from concurrent.futures import ThreadPoolExecutor
from jaxsub.units import to_si

sys.setswitchinterval(1e-5)
names = ("deg", "m/s", "deg/s", "knot", "rpm", "kN", "degC", "mV")
begin = threading.Barrier(8)

def one(number):
    begin.wait()
    order = names[number:] + names[:number]
    return {name: float(to_si(np.array([2.0]), name)[0]) for name in order}

with ThreadPoolExecutor(8) as pool:
    found = list(pool.map(one, range(8)))
assert all(other == found[0] for other in found), found
print(found[0]["deg"])
"""


def test_first_use_by_threads():
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert abs(float(done.stdout) - 0.03490658503988659) < 1e-15
