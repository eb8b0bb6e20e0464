"""The corpus of bad, odd and dialect inputs: small files, each with the answer that it must get.

A module `cases_*.py` beside this one lists `CASES`, which `test_inputs.py` runs and counts.
"""

import dataclasses
from collections.abc import Callable
from pathlib import Path


@dataclasses.dataclass(frozen=True)
class Case:
    """One input and its answer.

    - `name`: unique, says what is odd.
    - `make`: writes the input into an empty folder and returns the call's result, or raises `InputError`.
    - `refused`: words of the one-line error that it must raise; empty where it is read.
    - `check`: of the call's result, where it is read: raises AssertionError unless it is what was written.
    """

    name: str
    make: Callable[[Path], object]
    refused: tuple[str, ...] = ()
    check: Callable[[object], None] | None = None
