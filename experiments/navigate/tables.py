"""The tables of this experiment's page."""

from typing import Any

from ..tables import table

_ON_LINE = {
    "filter": "**`navigate`, filter**", "library": "filter called in Python", "vqf": "VQF on line",
    "vqf_without_delay": "VQF, delay removed", "published_madgwick": "Madgwick, published",
    "published_mahony": "Mahony, published", "ahrs_ekf": "`ahrs` EKF",
}  # fmt: skip
_OFF_LINE = {
    "smoother": "**`navigate`, smoother**",
    "vqf_offline": "VQF off line",
    "vqf_offline_without_delay": "VQF off line, delay removed",
}
_ATTITUDE = ("roll", "pitch", "roll_less_mean", "pitch_less_mean", "heading")
_DISTANCES = ("position_m", "outage_rms_m", "outage_final_m")


def tables(results: dict[str, Any]) -> dict[str, str]:
    """Orientation errors by method and trial, magnetometers, and what fixes alone show of a flight."""
    found = {
        "on line": _methods(results["broad"], _ON_LINE),
        "off line": _methods(results["broad"], _OFF_LINE),
        "magnetometer": _magnetometers(results["broad"]),
    }
    return found | ({"flights": _flights(results["ansfl"])} if "ansfl" in results else {})


def _methods(of: dict[str, Any], methods: dict[str, str]) -> str:
    trials = of["trials"]
    header = ["orientation error, °", *(name.replace("_", " ") for name in trials), "mean"]
    rows = []
    for name, words in methods.items():
        totals = [*(one["rmse_deg"][name]["total"] for one in trials.values()), of["mean_total_deg"][name]]
        rows.append([words, *(f"{total:.2f}" for total in totals)])
    return table(header, rows)


def _magnetometers(of: dict[str, Any]) -> str:
    header = ["trial", "delay, ms", "spread of the strength, as read", "calibrated"]
    rows = []
    for name, one in of["trials"].items():
        field = one["magnetometer"]
        delay = f"{1e3 * field['delay']:.1f} ± {1e3 * field['delay_std']:.1f}"
        spread = [f"{100.0 * field[when]:.1f} %" for when in ("before", "after")]
        rows.append([name.replace("_", " "), delay, *spread])
    return table(header, rows)


def _flights(of: dict[str, Any]) -> str:
    header = ["rms", "filter", "smoother", "filter called in Python"]
    columns = [of["mean"][name] for name in ("filter", "smoother", "library")]
    words = {
        "roll": "roll, °", "pitch": "pitch, °", "roll_less_mean": "roll less its mean, °",
        "pitch_less_mean": "pitch less its mean, °", "heading": "heading, °", "position_m": "position, m",
        "outage_rms_m": "position over 10 s without fixes, m", "outage_final_m": "the same at the end, m",
    }  # fmt: skip
    shown = lambda column, key: f"{column[key]:.2f}" if key in column else "–"
    rows = [[words[key], *(shown(column, key) for column in columns)] for key in (*_ATTITUDE, *_DISTANCES)]
    return table(header, rows)
