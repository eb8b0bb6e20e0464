"""Every case, what was concealed and what was answered, and the error on the test run before and after."""

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

COLOURS = {"right": "#1f4e79", "ambiguous": "#c9a227", "wrong": "#b5482a"}


def draw(results: dict, path: Path) -> None:
    """A line a case: the largest rms(residual)/σ of a channel of the test run, of the file fitted and of the answer."""
    cases = [line for line in results["cases"] if line["answer"].get("held_out")]
    figure, axis = plt.subplots(figsize=(9.0, 1.2 + 0.5 * len(cases)), layout="constrained")
    for row, line in enumerate(cases):
        held, colour = line["answer"]["held_out"], COLOURS[line["mark"]]
        before, after = (max(held[model].values()) for model in ("baseline", "improved"))
        axis.plot([before, after], [row, row], color=colour, lw=2)
        axis.plot(before, row, "o", mfc="white", mec=colour, label="fitted file" if not row else None)
        axis.plot(after, row, "o", color=colour, label="answer" if not row else None)
        names = ", ".join(dict.fromkeys(entry["effect"] for entry in line["answer"]["physics"]))
        text = f"{line['answer']['verdict']}{': ' + names if names else ''} ({line['mark']})"
        # a fitted file that diverges has no error
        far = np.nanmax([before, after])
        axis.annotate(text, (far, row), (8, 0), textcoords="offset points", va="center", fontsize=8)
    axis.axvline(1.0, color="0.6", lw=1)
    axis.set_yticks(range(len(cases)), [f"{line['vehicle']}:\n{line['concealed']}" for line in cases], fontsize=8)
    axis.set_ylim(max(len(cases), 1) - 0.5, -0.5)
    axis.set_xscale("log")
    axis.margins(x=0.5)
    axis.set_xlabel("largest rms residual of a channel on the test run, in σ")
    if cases:
        axis.legend(fontsize=8, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2)
    figure.savefig(path, dpi=110)
    plt.close(figure)
