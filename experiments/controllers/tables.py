"""The tables of this experiment's page."""

from typing import Any

from ..tables import table

_WAYS = {"JAX": "JAX, compiled", "CasADi": "CasADi function", "C": "C made from it", "exported": "exported program"}
_MODELS = {"baseline": "baseline", "improved": "improved", "truth": "the truth's own"}


def tables(results: dict[str, Any]) -> dict[str, str]:
    """Exports beside the plant; of each concealed effect the diagnosis, and errors and times of three controllers."""
    cases = {name: found for name, found in results.items() if "controllers" in found}
    made = {"exports": _exports(results["agreement"]), "diagnoses": _diagnoses(cases)}
    for name, found in cases.items():
        made |= {f"{name}, errors": _errors(found["controllers"]), f"{name}, times": _times(found["controllers"])}
    return made


def _exports(agreement: dict[str, Any]) -> str:
    found = agreement["NPS AUV II with memories"]
    rows = [
        (_WAYS.get(name, f"{name} system"), "–" if name == "JAX" else f"{one['error']:.2g}", f"{one['step_us']:.3g}")
        for name, one in found["steps"].items()
    ]
    return table(("the same step as", "error, of each state's size", "µs a step"), rows)


def _diagnoses(cases: dict[str, Any]) -> str:
    rows = []
    for found in cases.values():
        effect, *true = found["concealed"].values()
        named = ", ".join(f"`{name}`" for name in found["named"])
        sizes = [", ".join(f"{value:.4g}" for value in values) for values in (true, found["found"].values())]
        rows.append((f"`{effect}`", sizes[0], f"`{found['verdict']}`", named, sizes[1]))
    return table(("concealed", "its number", "verdict", "named", "number found"), rows)


def _errors(models: dict[str, Any]) -> str:
    rows = []
    for name, words in _MODELS.items():
        one = models[name]
        each = one["heading_rms_deg_of_each"]
        rows.append((
            words,
            f"{one['heading_rms_deg']:.2f}° ({min(each):.2f}–{max(each):.2f})",
            f"{100.0 * one['depth_rms_m']:.1f} cm",
            f"{one['deflection_rms_deg']:.2f}°",
            f"{one['deflection_rate_rms_deg_s']:.2f}°/s",
            f"{100.0 * one['share_of_samples_past_a_limit']:.2g} %",
        ))  # fmt: skip
    header = (
        "model in the controller",
        "heading",
        "depth",
        "rudder and elevators",
        "their rate",
        "samples past a limit",
    )
    return table(header, rows)


def _times(models: dict[str, Any]) -> str:
    rows = [
        (words, *(f"{models[name]['processor_ms'][at]:.1f}" for at in ("p50", "p99", "p100")))
        for name, words in _MODELS.items()
    ]
    return table(("estimate and plan, ms of processor time", "p50", "p99", "worst"), rows)
