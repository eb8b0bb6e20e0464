"""Rows and key numbers of the page that need more than a format: what the template cannot read off a diagnosis."""

import dataclasses
import itertools
import math

import tomlkit

from ..discrepancy.diagnosis import ChannelQuality, Diagnosis, Location
from .text import number, ratio, symbol

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
    """rms(residual)/σ as text and the tone that says how far it is from the noise floor."""

    text: str
    tone: str


@dataclasses.dataclass(frozen=True)
class FitRow:
    """One channel's cells, in the order of `fit_columns`."""

    channel: str
    cells: list[FitCell]


@dataclasses.dataclass(frozen=True)
class ChannelRow:
    """One channel's noise; `factor` is recorded over stated, `flagged` when that is too far from 1."""

    quality: ChannelQuality
    factor: float
    flagged: bool


def fit_columns(diagnosis: Diagnosis) -> list[tuple[str, str]]:
    """The (set, model) pairs that are worth showing: no improved model where nothing was accepted."""
    models = ["baseline", "improved"] if diagnosis.physics else ["baseline"]
    pairs = itertools.product(("train", "held_out"), models)
    return [(runs, model) for runs, model in pairs if diagnosis.fit.get(runs, {}).get(model)]


def fit_rows(diagnosis: Diagnosis) -> list[FitRow]:
    """One row for each channel that any column has."""
    columns = [diagnosis.fit[runs][model] for runs, model in fit_columns(diagnosis)]
    channels = dict.fromkeys(channel for column in columns for channel in column)
    return [FitRow(channel, [_fit_cell(column.get(channel)) for column in columns]) for channel in channels]


def channel_rows(diagnosis: Diagnosis) -> list[ChannelRow]:
    """Each channel with its recorded noise over its stated one."""
    rows = []
    for quality in diagnosis.channels:
        factor = quality.record_sigma / quality.sigma if quality.sigma > 0.0 else math.nan
        rows.append(ChannelRow(quality, factor, factor > _SAME_SIGMA or factor < 1.0 / _SAME_SIGMA))
    return rows


def gain_number(diagnosis: Diagnosis) -> KeyNumber | None:
    """The unseen channel that gained most, or without an improved model the one that is worst; None without any."""
    fit = diagnosis.fit.get("held_out", {})
    before, after = fit.get("baseline", {}), fit.get("improved", {}) if diagnosis.physics else {}
    both = [channel for channel in before if channel in after]
    if both:
        best = max(both, key=lambda channel: before[channel] / max(after[channel], 1e-9))
        value = f"{ratio(before[best])} → {ratio(after[best])}"
        return KeyNumber(
            value, f"residual/σ of {symbol(best)}, unseen runs", "most improved channel; 1 is the noise floor"
        )
    if before:
        worst = max(before, key=lambda channel: before[channel])
        return KeyNumber(
            ratio(before[worst]), f"residual/σ of {symbol(worst)}, unseen runs", "worst channel; 1 is the noise floor"
        )
    return None


def run_number(diagnosis: Diagnosis) -> KeyNumber:
    """How many runs there are and how they were used."""
    held_out = sum(run.role != "train" for run in diagnosis.runs)
    minutes = sum(run.duration for run in diagnosis.runs) / 60.0
    label = "run" if len(diagnosis.runs) == 1 else "runs"
    detail = f"{len(diagnosis.runs) - held_out} fitted, {held_out} held out; {minutes:.1f} min in all"
    return KeyNumber(str(len(diagnosis.runs)), label, detail)


def intervals(place: Location) -> list[str]:
    """`dive-2: 12–31.5 s, 40–44 s` for each run in which the mismatch is significant."""
    lines = []
    for run in dict.fromkeys(run for run, _, _ in place.times):
        own = [f"{_seconds(start)}–{_seconds(end)}" for name, start, end in place.times if name == run]
        more = f" and {len(own) - _MOST_INTERVALS} more" if len(own) > _MOST_INTERVALS else ""
        lines.append(f"{run}: {', '.join(own[:_MOST_INTERVALS])} s{more}")
    return lines


def effects_text(vehicle_text: str) -> str:
    """The `[[effects]]` part of a vehicle file; empty when it has none."""
    effects = tomlkit.parse(vehicle_text).get("effects")
    return tomlkit.dumps({"effects": effects}).strip() if effects else ""


def _seconds(time: float) -> str:
    return number(round(time, 1), 9)


def _fit_cell(value: float | None) -> FitCell:
    if value is None or math.isnan(value):
        return FitCell(ratio(value), "")
    return FitCell(ratio(value), next(tone for limit, tone in _TONES if value <= limit))
