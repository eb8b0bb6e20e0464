"""The page: one HTML file with everything in it, and the figures beside it as files."""

import base64
import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jinja2
from markupsafe import Markup

from ..discrepancy.records.decisions import decision_rows
from ..discrepancy.records.diagnosis import Conclusions
from ..storage import installed_version
from . import tables, text
from .bars import top_candidates
from .drawing import Picture, write_figures
from .figures import draw
from .forces import is_equation, telling_trace
from .overlay import telling_overlay
from .residual import located_device

if TYPE_CHECKING:
    from .exploring import Explorer

_VERDICTS = {
    "none": "no mismatch",
    "named": "physics named",
    "ambiguous": "ambiguous",
    "unknown": "unknown physics",
}
_KINDS = {
    "structure": "the vehicle’s structure",
    "actuator": "an actuator",
    "sensor": "a sensor",
    "environment": "the surroundings",
    "disturbance": "disturbance forces and noise",
}

_BY_EFFECTS = (
    " Blue: the force of the effects added. Orange: the same by the recordings, which is what the baseline and the"
    " force that it lacks make of them."
)
_FORCES = "Above: the force that the model lacks in a training run, with its ±2σ band. Below: force by state."
_BEYOND = " Orange: what the model lacks by the recordings."
# as in CITATION.cff
TITLE = "jaxsub: differentiable models of vehicles that move in water, and a diagnosis of the physics that they lack"


def write_report(diagnosis: Conclusions, vehicle_text: str, folder: Path) -> None:
    """Write `report.html`, which needs no other file, and `figures/*.png` into `folder`.

    They show `diagnosis`. `vehicle_text` is the improved vehicle file, of which the page shows the effects. Existing
    files are replaced.
    """
    pictures = draw(diagnosis)
    write_figures(pictures.values(), folder)
    page = render(diagnosis, vehicle_text, pictures, _explorers(diagnosis))
    (folder / "report.html").write_text(page, encoding="utf-8")


def render(
    diagnosis: Conclusions,
    vehicle_text: str,
    pictures: dict[str, Picture],
    shown: "Mapping[str, Explorer] | None" = None,
) -> str:
    """The page as text, with `pictures` inlined, and with figures to explore where they are `shown`."""
    scripts = _scripts() if shown else []
    context: dict[str, Any] = {
        "diagnosis": diagnosis,
        "verdict": _VERDICTS[diagnosis.verdict],
        "pictures": pictures,
        "explorers": shown or {},
        "scripts": [Markup(text) for text in scripts],
        "policy": _policy(scripts),
        "forces_words": _FORCES + (_BY_EFFECTS if diagnosis.improves else _BEYOND),
        "kinds": {kind: _KINDS.get(kind, kind) for kind in diagnosis.kinds},
        "effects": _added(diagnosis, vehicle_text) if diagnosis.improves else "",
        "key_numbers": _key_numbers(diagnosis),
        "force_run": telling_trace(diagnosis),
        "device": located_device(diagnosis),
        "device_caption": _device_caption(diagnosis),
        "by_state_words": _BY_EFFECTS if diagnosis.improves else _BEYOND,
        "citation_title": TITLE,
        "version": installed_version("jaxsub"),
        "overlay": telling_overlay(diagnosis),
        "candidates": top_candidates(diagnosis),
        "fit_columns": tables.fit_columns(diagnosis),
        "fit_rows": tables.fit_rows(diagnosis),
        "check_rows": tables.check_rows(diagnosis),
        "findings": tables.finding_rows(diagnosis.findings),
        "channel_rows": tables.channel_rows(diagnosis),
        "decision_rows": decision_rows(diagnosis.decisions),
    }
    return environment().get_template("template.html.j2").render(context)


def _added(diagnosis: Conclusions, vehicle_text: str) -> str:
    return tables.effects_text(vehicle_text, {coefficient.name for coefficient in diagnosis.coefficients})


def _explorers(diagnosis: Conclusions) -> "dict[str, Explorer]":
    # imported here, since Bokeh takes two seconds that a command without a report need not spend
    from .explorers import explorers

    return explorers(diagnosis)


def _scripts() -> list[str]:
    """Bokeh's script, and the one that puts its figures into the page."""
    from .exploring import script

    return [script(), (Path(__file__).parent / "explorers.js").read_text(encoding="utf-8")]


def _policy(scripts: Sequence[str]) -> str:
    """The page's content security policy: it fetches nothing, and runs its own `scripts` alone."""
    digests = (base64.b64encode(hashlib.sha256(one.encode()).digest()).decode("ascii") for one in scripts)
    allowed = " ".join(f"'sha256-{digest}'" for digest in digests) or "'none'"
    return f"default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src {allowed}"


def _device_caption(diagnosis: Conclusions) -> str:
    device = located_device(diagnosis)
    if device is None:
        return ""
    return (
        f"Residual of {text.symbol(device.channel)} on a test run, where the mismatch of "
        f"{text.place_name(device.place)} shows. Left: over time. Right: over the modelled value, where a wrong scale "
        "is a slope and a bias a shift."
    )


def _key_numbers(diagnosis: Conclusions) -> list[tables.KeyNumber]:
    of = (tables.explained_number, tables.effect_number, tables.gain_number, tables.run_number)
    return [number for number in (one(diagnosis) for one in of) if number is not None]


def environment() -> jinja2.Environment:
    """Templates of this room, with numbers and formulas as a person would write them."""
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("jaxsub.report", ""),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
        finalize=text.visible,
    )
    environment.filters.update(
        number=text.number,
        percent=text.percent,
        ratio=text.ratio,
        p_value=text.p_value,
        p_equals=text.p_equals,
        symbol=text.typeset,
        label=text.typeset_label,
        prose=text.prose,
        place=text.place_name,
        unit=text.unit,
        formula=text.formula,
        intervals=tables.intervals,
        regime=tables.regime,
        width=_width,
        embedded=_embedded,
    )
    environment.tests["equation"] = is_equation
    environment.globals["measurement"] = text.measurement
    return environment


def _width(share: float) -> str:
    """A share as the width of a bar, in CSS."""
    return f"{100.0 * min(max(share, 0.0), 1.0) if share == share else 0.0:.1f}%"


def _embedded(png: bytes) -> Markup:
    """A PNG as the address of an image that travels with the page."""
    return Markup("data:image/png;base64,{}").format(base64.b64encode(png).decode("ascii"))
