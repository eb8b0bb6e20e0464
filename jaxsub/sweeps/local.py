"""A sweep on this machine: as many chunks in one batch as its devices or cores can work on at once."""

import itertools
from collections.abc import Iterator, Sequence

from ..estimate.method import share_for, shares_at_once
from .plan import Chunk, Plan
from .run import Answers, run_chunks


def on_this_machine(plan: Plan, chunks: Sequence[Chunk]) -> Iterator[tuple[Chunk, Answers]]:
    """Each chunk and its answers, as they are done."""
    for case, own in itertools.groupby(chunks, lambda chunk: chunk.case):
        remaining = list(own)
        shares = -(-(remaining[0].last - remaining[0].first) // share_for(plan.problems[case]))
        together = max(1, shares_at_once() // shares)
        for first in range(0, len(remaining), together):
            batch = remaining[first : first + together]
            yield from zip(batch, run_chunks(plan, batch), strict=True)
