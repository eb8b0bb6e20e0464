"""Rows and key numbers of the page that need more than a format: what the template cannot read off a diagnosis."""

import dataclasses
import itertools
import math
from collections.abc import Collection, Mapping, Sequence

import numpy as np
import tomlkit
from markupsafe import Markup

from ..discrepancy import settings
from ..discrepancy.records.diagnosis import ChannelQuality, Conclusions, Location, Regime, Remainder
from ..effects import FORCE_UNITS
from ..findings import Finding
from .text import (
    UNKNOWN,
    formula,
    measurement,
    number,
    p_value,
    percent,
    place_name,
    ratio,
    symbol,
    typeset_label,
    unit,
)

_MOST_INTERVALS = 6  # of one run; more are counted
_SAME_SIGMA = 1.5  # factor by which stated and recorded noise may differ unremarked
# rms(residual)/σ up to which a cell has each tone; the last one has no limit.
_TONES = ((1.25, "floor"), (2.0, "near"), (5.0, "off"), (math.inf, "far"))


@dataclasses.dataclass(frozen=True)
class KeyNumber:
    """One large number of the header, what it counts, and a line of detail."""

    value: str
    label: str
    detail: str


@dataclasses.dataclass(frozen=True)
class FitCell:
    """rms(residual)/σ and the rms itself as text, and the tone that says how far it is from the noise floor.

    Where no noise is stated σ is what the baseline left, which is no floor, and there is no tone.
    """

    text: str
    size: str
    tone: str


@dataclasses.dataclass(frozen=True)
class FitRow:
    """One channel's cells, in the order of `fit_columns`."""

    channel: str
    cells: list[FitCell]


@dataclasses.dataclass(frozen=True)
class CheckCell:
    """One test of what a model leaves as text, `flagged` where chance alone would hardly do so."""

    text: str
    flagged: bool = False


@dataclasses.dataclass(frozen=True)
class CheckRow:
    """One channel's checks, each with a cell for every model: interval of rms/σ, randomness, going with an input."""

    channel: str
    cells: list[CheckCell]


@dataclasses.dataclass(frozen=True)
class ChannelRow:
    """One channel's noise; `factor` is recorded over used, `flagged` when a stated one is too far from what it is."""

    quality: ChannelQuality
    factor: float
    flagged: bool


def fit_columns(diagnosis: Conclusions) -> list[tuple[str, str]]:
    """The (set, model) pairs that are worth showing: no improved model where there is none."""
    models = ["baseline", "improved"] if diagnosis.improves else ["baseline"]
    pairs = itertools.product(("train", "held_out"), models)
    return [(runs, model) for runs, model in pairs if diagnosis.fit.get(runs, {}).get(model)]


def fit_rows(diagnosis: Conclusions) -> list[FitRow]:
    """One row for each channel that any column has."""
    columns = [diagnosis.fit[runs][model] for runs, model in fit_columns(diagnosis)]
    channels = dict.fromkeys(channel for column in columns for channel in column)
    quality = diagnosis.quality
    cells = lambda channel: [_fit_cell(column.get(channel), quality.get(channel)) for column in columns]
    return [FitRow(channel, cells(channel)) for channel in channels]


def check_rows(diagnosis: Conclusions) -> list[CheckRow]:
    """One row for each channel whose residuals on the test runs were tested."""
    models = list(diagnosis.remains.values())
    channels = models[0] if models else {}
    tests = (_between, _random, _follows)
    return [CheckRow(name, [test(left[name]) for test in tests for left in models]) for name in channels]


def channel_rows(diagnosis: Conclusions) -> list[ChannelRow]:
    """Each channel with its recorded noise over the one used."""
    rows = []
    for quality in diagnosis.channels:
        factor = quality.record_sigma / quality.sigma if quality.sigma > 0.0 else math.nan
        other = factor > _SAME_SIGMA or factor < 1.0 / _SAME_SIGMA
        rows.append(ChannelRow(quality, factor, other and not quality.sigma_estimated))
    return rows


def finding_rows(findings: Sequence[Finding]) -> list[Finding]:
    """What checks found, the gravest first."""
    order = ("error", "warning", "note")
    return sorted(findings, key=lambda finding: order.index(finding.severity))


def explained_number(diagnosis: Conclusions) -> KeyNumber | None:
    """How much of the test runs' error the improved model removes; None without one, or where there is no excess."""
    share = diagnosis.explained.share if diagnosis.explained else None
    if not diagnosis.improves or share is None:
        return None
    detail = "squared error above the sensors’ noise, all channels"
    return KeyNumber(percent(share) if share > 0.0 else "nothing", "of the test error is removed", detail)


def effect_number(diagnosis: Conclusions) -> KeyNumber | None:
    """The first number of the effect accepted first, with its unit and the largest force that it makes."""
    for found in diagnosis.physics:
        for name, estimate in found.parameters.items():
            value = f"{measurement(estimate.value, estimate.standard_error)} {unit(estimate.unit)}".rstrip()
            acts = ", ".join(_peak(diagnosis, equation) for equation in found.equations)
            return KeyNumber(value, Markup("{} of {}").format(formula(name), typeset_label(found.label)), acts)
    return None


def _peak(diagnosis: Conclusions, equation: str) -> str:
    """The place an effect acts on, and the largest force of the added effects there."""
    forces = [trace.modelled[equation] for trace in diagnosis.remaining_forces if equation in trace.modelled]
    if not forces:
        return place_name(equation)
    size = max(float(np.nanmax(np.abs(force), initial=0.0)) for force in forces)
    return f"up to {number(size, 2)} {FORCE_UNITS.get(equation, '')}".rstrip() + f" in {symbol(equation)}"


def gain_number(diagnosis: Conclusions) -> KeyNumber | None:
    """The unseen channel that gained most, or without an improved model the one that is worst; None without any.

    In its unit where that is known, and over the noise that is stated for it.
    """
    fit = diagnosis.fit.get("held_out", {})
    before, after = fit.get("baseline", {}), fit.get("improved", {}) if diagnosis.improves else {}
    both = [channel for channel in before if channel in after]
    if not before:
        return None
    gain = lambda channel: before[channel] / max(after[channel], 1e-9)
    chosen = max(both, key=gain) if both else max(before, key=lambda channel: before[channel])
    which = "most improved channel" if both else "worst channel"
    values = [models[chosen] for models in (before, after) if chosen in models]
    quality, ratios = diagnosis.quality.get(chosen), " → ".join(ratio(value) for value in values)
    if quality is None:
        return KeyNumber(ratios, f"rms error/σ of {symbol(chosen)}, test runs", f"{which}; 1 is the noise floor")
    floor = "" if quality.sigma_estimated else f"; {ratios} times its noise"
    return KeyNumber(_size(values, quality, 2), f"rms error of {symbol(chosen)}, test runs", which + floor)


def run_number(diagnosis: Conclusions) -> KeyNumber:
    """How many runs there are and how they were used."""
    held_out = sum(run.role != "train" for run in diagnosis.runs)
    minutes = sum(run.duration for run in diagnosis.runs) / 60.0
    label = "run" if len(diagnosis.runs) == 1 else "runs"
    detail = f"{len(diagnosis.runs) - held_out} for training, {held_out} for the test; {minutes:.1f} min in all"
    return KeyNumber(str(len(diagnosis.runs)), label, detail)


def intervals(place: Location) -> list[str]:
    """`dive-2: 12–31.5 s, 40–44 s` for each run in which the mismatch is significant."""
    lines = []
    for run in dict.fromkeys(run for run, _, _ in place.times):
        own = [_interval(start, end) for name, start, end in place.times if name == run]
        more = f" and {len(own) - _MOST_INTERVALS} more" if len(own) > _MOST_INTERVALS else ""
        lines.append(f"{run}: {', '.join(own[:_MOST_INTERVALS])} s{more}")
    return lines


def regime(found: Regime) -> Markup:
    """`|r| ≥ 0.12 rad/s`."""
    size = f"{number(found.threshold, 2)} {unit(found.unit)}".rstrip()
    return formula(found.variable) + f" {'≥' if found.above else '≤'} {size}"


def effects_text(vehicle_text: str, fitted: Collection[str]) -> str:
    """What a diagnosis added to a vehicle file, as it stands there; empty when it added nothing.

    That is its `[[effects]]`, and those free coefficients that are not among the `fitted`: effects of one derivative.
    """
    document = tomlkit.parse(vehicle_text)
    free = lambda entry: not (isinstance(entry, Mapping) and entry.get("fixed"))
    added = {n: entry for n, entry in document.get("coefficients", {}).items() if free(entry) and n not in fitted}
    parts = {"coefficients": added, "effects": document.get("effects")}
    return tomlkit.dumps({name: part for name, part in parts.items() if part}).strip()


def _size(values: Sequence[float], quality: ChannelQuality, digits: int = 3) -> str:
    """Multiples of a channel's σ in its unit, where it has one: `0.21 → 0.034 m/s`."""
    return f"{' → '.join(number(value * quality.sigma, digits) for value in values)} {unit(quality.unit)}".rstrip()


def _interval(start: float, end: float) -> str:
    first, last = (number(round(time, 1), 9) for time in (start, end))
    return first if first == last else f"{first}–{last}"


def _between(left: Remainder) -> CheckCell:
    return CheckCell(f"{ratio(left.low)}–{ratio(left.high)}" if math.isfinite(left.high) else UNKNOWN)


def _random(left: Remainder) -> CheckCell:
    return CheckCell(p_value(left.random), left.random < settings.RESIDUAL_LEVEL)


def _follows(left: Remainder) -> CheckCell:
    flagged = left.independent < settings.RESIDUAL_LEVEL
    return CheckCell(p_value(left.independent) + (f" ({left.follows})" if flagged else ""), flagged)


def _fit_cell(value: float | None, quality: ChannelQuality | None) -> FitCell:
    if value is None or math.isnan(value):
        return FitCell(ratio(value), "", "")
    size = _size([value], quality) if quality else ""
    no_floor = quality is not None and quality.sigma_estimated
    return FitCell(ratio(value), size, "" if no_floor else next(tone for limit, tone in _TONES if value <= limit))
