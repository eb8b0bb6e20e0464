"""Replacement: a coefficient of the baseline gives way to an effect that is another law of the same force.

The coefficient of a linear drag and that of a quadratic one are correlated estimates. Where one of them is enough, the
other only makes it less certain.
"""

import numpy as np

from .. import settings
from ..accept.acceptance import Model, fitted_model
from ..accept.cross_validation import compare
from ..accept.model import p_value, refit, wald_p_value
from ..accept.verdict import Judged, replacing
from ..linearise.view import look
from ..records.progress import Progress


def with_replacement(progress: Progress, model: Model, judged: Judged) -> tuple[Model, Judged]:
    """The model without the coefficients that its effects may replace, if these are not accepted beside them."""
    names = replaceable(model)
    if not names:
        return model, judged
    progress(f"fitting without {', '.join(names)}")
    zero = model.fit.vehicle.with_values({name: np.zeros(()) for name in names}).holding(names)
    fit = refit(model.fit, zero)
    fewer = fitted_model(fit, look(fit, model.view.disturbance), model.added)
    gain = compare(fewer.predicted, model.predicted)
    # the effects are to be significant without the coefficients too
    worst = max(p_value(fewer.view, effect) for effect in fewer.added) if fewer.admissible else 1.0
    label = f"{', '.join(names)} beside {', '.join(effect.label for effect in model.added if effect.replaces)}"
    held = not gain.accepted and worst < settings.SIGNIFICANCE
    return (fewer if held else model), replacing(judged, label, gain, worst, "held at zero" if held else "kept")


def replaceable(model: Model) -> list[str]:
    """The free coefficients that added effects may replace: zero is admissible, and Wald's test does not reject it."""
    replaced = {name for effect in model.added for name in effect.replaces}
    if not replaced:
        return []
    rows = model.view.vehicle.layout.free
    may = lambda row: row.name in replaced and row.lower <= 0.0 <= row.upper and not row.varies
    idle = lambda place: not wald_p_value(model.view, [place]) < settings.SIGNIFICANCE
    return [row.name for place, row in enumerate(rows) if may(row) and idle(place)]
