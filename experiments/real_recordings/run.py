"""Diagnosing a real set from files, as a user would, and keeping everything in one folder."""

import shutil
import time
from collections.abc import Mapping
from pathlib import Path

from jaxsub.cli.diagnose import answered, emit
from jaxsub.discrepancy import Conclusions
from jaxsub.discrepancy.records.diagnosis import ParameterEstimate
from jaxsub.vehicle import read_vehicle

from .by_hand import by_hand
from .case import Case, FieldUnit
from .figure import draw_held_out


def diagnose_case(case: Case, folder: Path) -> tuple[Conclusions, dict]:
    """The diagnosis and its numbers in field units.

    `folder` then holds the vehicle file, `diagnosis.json`, `improved.toml`, the report and `held_out.png`.
    """
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "vehicle.toml").write_text(case.vehicle, encoding="utf-8")
    shutil.rmtree(folder / "figures", ignore_errors=True)
    begin, spent = time.perf_counter(), time.process_time()
    answer = answered(read_vehicle(folder / "vehicle.toml"), case.train, case.held)
    diagnosis = answer.conclusions
    emit(answer)
    answer.write(folder)
    times = {"seconds": round(time.perf_counter() - begin, 1), "cpu_seconds": round(time.process_time() - spent, 1)}
    draw_held_out(diagnosis, case, folder / "held_out.png")
    return diagnosis, {**numbers(diagnosis, case), **times, "by_hand": by_hand(case, folder)}


def numbers(diagnosis: Conclusions, case: Case) -> dict:
    """What was left out, how large it is, the gain on the test runs, and what remains."""
    scaled = lambda rms: {f"{c} ({case.channels[c][1]})": case.channels[c][0] * value for c, value in rms.items()}
    return {
        "verdict": diagnosis.verdict,
        "summary": diagnosis.summary,
        "left_out": [
            {
                "effect": found.label,
                "expression": found.expression,
                "probability": found.probability,
                "rivals": {rival.label: rival.probability for rival in found.rivals},
                "parameters": {s: in_field_units(s, e, case.parameters) for s, e in found.parameters.items()},
            }
            for found in diagnosis.physics
        ],
        "held_out_rms": {
            "before": scaled(diagnosis.history[0][1]),
            "after": scaled(diagnosis.history[-1][1]),
        },
        "published": dict(case.published),
        "remains": {
            "rms_over_sigma": {part: diagnosis.fit[part]["improved"] for part in ("train", "held_out")},
            "notes": diagnosis.notes,
            "where": [{"where": p.where, "share": p.share, "grows_with": p.grows_with} for p in diagnosis.where],
            "next_manoeuvre": diagnosis.next_manoeuvre,
        },
        "coefficients": {
            c.name: in_field_units(c.name, c.improved, case.parameters) | {"verdict": c.verdict}
            for c in diagnosis.coefficients
            if c.improved
        },
        "prepared": case.prepared,
        "runs": {"train": [r.name for r in case.train], "held_out": [r.name for r in case.held]},
    }


def in_field_units(symbol: str, estimate: ParameterEstimate, units: Mapping[str, FieldUnit]) -> dict:
    """An estimate as its field writes it."""
    factor, unit = units.get(symbol, (1.0, estimate.unit))
    return {"value": factor * estimate.value, "standard_error": abs(factor) * estimate.standard_error, "unit": unit}
