"""One examination: the evidence of all candidates, and of a nonparametric force, along one filtered trajectory."""

import numpy as np

from ...effects import AbstractEffect, RunVariation, candidates, looked_at
from ...likelihood import whitened
from ..accept.acceptance import Examination
from ..linearise.columns import candidate_columns
from ..linearise.evidence import Evidence
from ..linearise.view import View, facts
from ..linearise.whiteness import Memory, memory
from ..programs import make_room
from ..propose.name import Naming, name
from ..propose.nonparametric import pattern
from ..propose.selector import Selector
from ..propose.tuned import tuned
from ..records.progress import Progress


def examine(view: View, vocabulary: tuple[type[AbstractEffect], ...] | None, progress: Progress) -> Examination:
    """The effects selected along the filtered trajectory of a view, and the best nonparametric force beside them."""
    return weighed(view, listed(view, vocabulary), progress)


def listed(view: View, vocabulary: tuple[type[AbstractEffect], ...] | None, *, present: bool = False) -> Selector:
    """All candidates that the vehicle of a view does not have; or also those that are `present` in it."""
    make_room()
    there = set() if present else {effect.label for effect in view.vehicle.all_effects}
    known = tuned(view, facts(view))
    effects = [effect for effect in candidates(known, vocabulary) if effect.label not in there]
    varying = [effect for effect in effects if isinstance(effect, RunVariation)]
    others = [effect for effect in effects if not isinstance(effect, RunVariation)]
    columns, owners = candidate_columns(view, others)
    free = [row.name for row in view.vehicle.layout.free]
    evidence = Evidence.of(view, columns, varied=[free.index(effect.number) for effect in varying])
    owners += [[len(columns) + k] for k in range(len(varying))]
    return Selector(evidence, [*others, *varying], owners, looked_at(known, vocabulary))


def weighed(view: View, selector: Selector, progress: Progress) -> Examination:
    """The examination by the usable candidates of a selector."""
    naming, evidence = name(selector, progress), selector.evidence
    progress("looking for nonparametric forces")
    bare = evidence.best([])[1]
    under = [naming.products] if naming.products is bare else [bare, naming.products]
    return Examination(
        view, selector, naming, pattern(view, evidence, naming.columns, under), _memory(evidence, naming)
    )


def _memory(evidence: Evidence, naming: Naming) -> Memory:
    """The test of whether the innovations that the selected effects leave are white."""
    products = naming.products
    system = evidence.within(naming.columns, products).view.followed.system
    white, _ = whitened(products.disturbance, system, evidence.left(naming.columns, products))
    gain = 2.0 * (naming.value - evidence.best([])[0])
    return memory(np.asarray(white)[..., 0], np.asarray(system.measured), gain)
