"""What the vocabulary, and a force without a name, say about the recordings of one view."""

import numpy as np

from ..effects import AbstractEffect, candidates, looked_at
from ..likelihood import whitened
from .acceptance import Examination
from .columns import candidate_columns
from .evidence import Evidence
from .generic import pattern
from .name import Naming, name
from .programs import make_room
from .progress import Progress
from .selector import Selector
from .tuned import tuned
from .view import View, facts
from .whiteness import RANDOM, Memory, memory


def examine(view: View, vocabulary: tuple[type[AbstractEffect], ...] | None, progress: Progress) -> Examination:
    """Name what the recordings of a view ask for, and see whether a force without a name would say it better."""
    return weighed(view, listed(view, vocabulary), progress)


def listed(view: View, vocabulary: tuple[type[AbstractEffect], ...] | None, *, present: bool = False) -> Selector:
    """All that the recordings of a view may ask for and that its vehicle does not have; or also what is `present`."""
    make_room()
    there = set() if present else {effect.label for effect in view.vehicle.effects}
    known = tuned(view, facts(view))
    effects = [effect for effect in candidates(known, vocabulary) if effect.label not in there]
    columns, owners = candidate_columns(view, effects)
    return Selector(Evidence.of(view, columns), effects, owners, looked_at(known, vocabulary))


def weighed(view: View, selector: Selector, progress: Progress) -> Examination:
    """What the candidates of a selector that are usable say, and a force without a name beside them."""
    naming, evidence = name(selector, progress), selector.evidence
    if naming.again:
        return Examination(view, selector, naming, None, RANDOM)
    progress("looking for forces without a name")
    bare = evidence.best([])[1]
    under = [naming.products] if naming.products is bare else [bare, naming.products]
    return Examination(
        view, selector, naming, pattern(view, evidence, naming.columns, under), _memory(evidence, naming)
    )


def _memory(evidence: Evidence, naming: Naming) -> Memory:
    """Whether what the named leave is random."""
    products, system = naming.products, evidence.view.followed.system
    white, _ = whitened(products.disturbance, system, evidence.left(naming.columns, products))
    gain = 2.0 * (naming.value - evidence.best([])[0])
    return memory(np.asarray(white)[..., 0], np.asarray(system.measured), gain)
