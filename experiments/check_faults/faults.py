"""Faults of growing size, each put into a run of the surface vessel, and what a check has to say of it."""

import dataclasses
import math
from collections.abc import Callable

import numpy as np

from jaxsub.findings import Finding
from jaxsub.recording import Recording

Change = Callable[[Recording, float, np.random.Generator], Recording]


@dataclasses.dataclass(frozen=True)
class Fault:
    """A kind of fault.

    **Fields**

    - `unit`: of the sizes. `sizes`: what is tried, from what nobody could see to what nobody could miss.
    - `put`: gives the run with the fault of a size.
    - `checks`: the checks, and `channel` the channel, of a finding that names it; `word` is in its text.
    """

    unit: str
    sizes: tuple[float, ...]
    put: Change
    checks: tuple[str, ...]
    channel: str
    word: str = ""

    def named(self, findings: tuple[Finding, ...]) -> bool:
        """Whether one of the findings names the fault."""
        return any(
            finding.check in self.checks and finding.channel == self.channel and self.word in finding.what
            for finding in findings
        )


def _with(run: Recording, **columns: np.ndarray) -> Recording:
    return dataclasses.replace(run, columns=run.columns | columns)


def _spike(run: Recording, size: float, draws: np.random.Generator) -> Recording:
    values = run.columns["v"].copy()
    values[draws.integers(5, values.size - 5)] += 0.01 * size * draws.choice([-1.0, 1.0])
    return _with(run, v=values)


def _stuck(run: Recording, size: float, draws: np.random.Generator) -> Recording:
    values = run.columns["r"].copy()
    first = int(draws.integers(30, values.size - 30 - int(size)))
    values[first : first + int(size)] = values[first]
    return _with(run, r=values)


def _sentinel(run: Recording, size: float, draws: np.random.Generator) -> Recording:
    values = run.columns["u"].copy()
    values[draws.choice(values.size, int(size), replace=False)] = -32.768
    return _with(run, u=values)


def _late(name: str) -> Change:
    def put(run: Recording, size: float, draws: np.random.Generator) -> Recording:
        return _with(run, **{name: np.interp(run.times - size, run.times, run.columns[name])})

    return put


def _scaled(name: str) -> Change:
    return lambda run, size, draws: _with(run, **{name: size * run.columns[name]})


def _swapped(one: str, other: str) -> Change:
    return lambda run, size, draws: _with(run, **{one: run.columns[other], other: run.columns[one]})


def _offset(run: Recording, size: float, draws: np.random.Generator) -> Recording:
    return _with(run, r=run.columns["r"] + size * float(np.std(run.columns["r"])))


def _clock(run: Recording, size: float, draws: np.random.Generator) -> Recording:
    slow = run.times - size * (run.times - run.times[0]) / run.duration
    moved = {name: np.interp(slow, run.times, run.columns[name]) for name in ("x", "y")}
    return _with(run, **moved)


_DELAYS = (0.1, 0.2, 0.3, 0.5, 1.0, 2.0)
_FACTORS = (1.05, 1.1, 1.2, 1.5, 2.0, 180.0 / math.pi)
FAULTS = {
    "one spike in v": Fault("σ", (4.0, 8.0, 12.0, 20.0, 40.0, 80.0), _spike, ("spike",), "v"),
    "r stuck": Fault("samples", (5.0, 8.0, 12.0, 20.0, 40.0), _stuck, ("stuck",), "r"),
    "sentinels in u": Fault("samples", (1.0, 2.0, 5.0, 20.0), _sentinel, ("sentinel", "spike"), "u"),
    "r late": Fault("s", _DELAYS, _late("r"), ("delay",), "r"),
    "psi late": Fault("s", _DELAYS, _late("psi"), ("delay",), "psi"),
    "u late": Fault("s", _DELAYS, _late("u"), ("delay",), "u"),
    "r by a factor": Fault("", _FACTORS, _scaled("r"), ("factor",), "psi", "r"),
    "u by a factor": Fault("", (*_FACTORS[:-1], 1000.0), _scaled("u"), ("factor",), "u"),
    "r reversed": Fault("", (-1.0,), _scaled("r"), ("sign",), "psi", "r"),
    "v reversed": Fault("", (-1.0,), _scaled("v"), ("sign",), "v"),
    "x and y swapped": Fault("", (1.0,), _swapped("x", "y"), ("axis",), "x", "x and y"),
    "u and v swapped": Fault("", (1.0,), _swapped("u", "v"), ("axis",), "x", "u and v"),
    "r with an offset": Fault("rms of r", (0.1, 0.3, 0.5, 1.0, 2.0), _offset, ("drift",), "psi", "r"),
    "clock of x, y slow": Fault("s at the end", (0.5, 1.0, 2.0, 4.0), _clock, ("clock", "delay"), "x"),
}
