"""The tables of this experiment's page."""

from typing import Any

from ..tables import table


def tables(results: dict[str, Any]) -> dict[str, str]:
    """Errors on test runs before and after, by hand, and what was named."""
    return {
        "roll decay": _by_channel(results["kvlcc2_rolldecay"]),
        "emps": _by_channel({"": results["emps"]}),
        "silverbox": _silverbox(results["silverbox"]),
        "zigzags": _by_channel({"": results["kvlcc2_freerunning"]}),
        "zigzags, fit": _fit(results["kvlcc2_freerunning"]),
        "slocum": _by_channel(_spelled(results["slocum_comet2016"])),
        "seaglider": _by_channel(_spelled(results["seaglider_sg542"])),
    }


def _by_channel(cases: dict[str, dict[str, Any]]) -> str:
    """A row for each case and channel: errors of the baseline, the improved model and the one by hand."""
    rows = []
    for name, found in cases.items():
        before, after = (found["held_out_rms"][when] for when in ("before", "after"))
        by_hand = found["by_hand"]["held_out_rms"]["picked"]
        for channel in before:
            errors = [f"{of[channel]:.3g}" for of in (before, after, by_hand)]
            rows.append([f"{name} {channel}".strip(), *errors, f"`{found['verdict']}`", _named(found)])
    return table(["test run, rms", "baseline", "improved", "by hand", "verdict", "named"], rows)


def _spelled(cases: dict[str, Any]) -> dict[str, Any]:
    """The cases with and without the recorded density of the water."""
    said = {"density": "with density,", "no_density": "without density,"}
    return {said[name]: found for name, found in cases.items()}


def _fit(found: dict[str, Any]) -> str:
    """How much of each channel's variation in the test runs simulation follows."""
    rows = found["held_out_fit_percent"]
    channels = list(rows["baseline"])
    return table(["fit, %", *channels], [[model, *(f"{of[c]:.1f}" for c in channels)] for model, of in rows.items()])


def _named(found: dict[str, Any]) -> str:
    """Each effect with its probability and its rivals'."""
    said = []
    for one in found["left_out"]:
        rivals = "".join(f"; `{name}` {p:.2f}" for name, p in one["rivals"].items())
        said.append(f"`{one['effect']}` {one['probability']:.2f}{rivals}")
    return ", ".join(said) or "nothing"


def _silverbox(found: dict[str, Any]) -> str:
    """Errors through the whole tests, published ones beside them."""
    tests = list(found["whole_test_rmse_mV"]["baseline"])
    rows = [[model, *(f"{of[test]:.2f}" for test in tests)] for model, of in found["whole_test_rmse_mV"].items()]
    published = [[name, *values.split(" / ")] for name, values in found["published"].items() if "NARX" in name]
    return table(["RMSE, mV", *tests], [*rows, *published])
