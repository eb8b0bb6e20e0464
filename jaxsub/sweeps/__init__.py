"""Sweeps: Monte-Carlo over initial guesses, noise, vehicles and recordings, on this machine or on a cluster."""

from ..results import OUTCOMES
from .answers import answered
from .dataset import open_sweep
from .description import described
from .execute import sweep
from .limits import require_memory
from .plan import Chunk, Plan
from .run import run_chunks
from .store import Store, check_folder
from .summary import succeeded, summarised

__all__ = [
    "OUTCOMES",
    "Chunk",
    "Plan",
    "Store",
    "answered",
    "check_folder",
    "described",
    "open_sweep",
    "require_memory",
    "run_chunks",
    "succeeded",
    "summarised",
    "sweep",
]
