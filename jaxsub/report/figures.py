"""All figures of a report."""

from ..discrepancy.records.diagnosis import Conclusions
from .bars import draw_by_run, draw_coefficients, draw_scan
from .by_state import draw_by_state
from .checks import draw_checks
from .drawing import Picture, style
from .forces import draw_forces
from .overlay import draw_overlay
from .residual import draw_residual

_FIGURES = (
    draw_residual, draw_forces, draw_by_state, draw_scan, draw_overlay, draw_checks, draw_coefficients, draw_by_run,
)  # fmt: skip


def draw(diagnosis: Conclusions) -> dict[str, Picture]:
    """The figures that the diagnosis has data for, by name.

    `residual` (of a sensor's or actuator's channel), `forces`, `by-state`, `scan`, `before-after`, `checks`,
    `coefficients` and `by-run`.
    """
    with style():
        drawn = [draw_figure(diagnosis) for draw_figure in _FIGURES]
    return {picture.name: picture for picture in drawn if picture is not None}
