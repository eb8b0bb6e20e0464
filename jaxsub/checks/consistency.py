"""Channels that contradict each other by kinematics alone, and the single fault that explains it best."""

from collections.abc import Mapping

import numpy as np

from ..findings import Finding
from ..recording import Recording
from ..vehicle import Layout
from .explanations import contradiction, explanation
from .relations import Motions, body_relations, mechanism_relations
from .search import Search

_MOST = 4  # faults named in one run
_ROWS, _BLOCKS = 20_000, 10  # of a longer run as many rows are looked at, in so many stretches
_REACH = 3.0  # m: of a lever arm, where the vehicle has no length


def consistency(recording: Recording, layout: Layout, columns: Mapping[str, np.ndarray], speed: float) -> list[Finding]:
    """What is wrong between the channels of a run, whose samples are `columns`; `speed` (m/s) where surge is locked.

    Every fault of one channel or instrument that could be is undone in turn, and the one after which all relations
    agree best is named, then the next. A fault counts if it makes the data more likely by a factor of e³⁰ than none.
    """
    body = layout.kind == "submerged-body"
    motions = Motions.of(layout, columns, speed)
    if len(motions.columns) < 2:
        return []
    relations = body_relations(motions) if body else mechanism_relations(layout, motions)
    rows = _rows(len(recording.times))
    looked_at = motions.replaced({name: values[rows] for name, values in motions.columns.items()})
    search = Search(recording.times[rows], looked_at, relations, layout.length or _REACH)
    findings, explained, named = [], set(), set()
    for _ in range(_MOST):
        best = search.best(named)
        if best is None:
            break
        mend, relation = best
        findings.append(explanation(recording, mend, relation, search.distance(relation, mend)))
        explained |= relation.among
        search = search.mended(mend)
        named.add((mend.kind, mend.channels))
    # what a fault does to others is no contradiction of its own
    return findings + [
        contradiction(recording, relation, found)
        for relation in relations
        if not explained & relation.among and relation.exact and (found := search.contradicts(relation)) is not None
    ]


def _rows(count: int) -> np.ndarray:
    """The rows of a run that are looked at: all, or stretches of a long one."""
    if count <= _ROWS:
        return np.arange(count)
    length = _ROWS // _BLOCKS
    return np.concatenate([first + np.arange(length) for first in np.linspace(0, count - length, _BLOCKS).astype(int)])
