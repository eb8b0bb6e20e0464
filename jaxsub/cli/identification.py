"""What `jaxsub identify` found: as tables and sentences, as JSON, and as files."""

import csv
import dataclasses
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..estimate import Assessment, ChannelResidual, Solution
from ..findings import Finding
from ..information import Coloured, Estimate, Identifiability, estimates
from ..plain import to_json
from ..report.text import unit
from ..results import RESULTS
from ..vehicle import write_vehicle

Cells = tuple[Sequence[str], list[Sequence[str]]]


@dataclasses.dataclass(frozen=True)
class Identification:
    """A fit and what follows from it.

    **Fields**

    - `fit`, `method`: the fit and the method's name. `where`: the runs, as the user named them.
    - `assessment`: whether it explains the runs. `said`, `coloured`: what the runs identify, and the standard errors
      that allow for coloured residuals; None where the command was interrupted before.
    - `complete`: whether nothing was interrupted.
    """

    fit: Solution
    method: str
    where: str
    assessment: Assessment
    said: Identifiability | None
    coloured: Coloured | None
    complete: bool

    @property
    def estimates(self) -> list[Estimate]:
        """The coefficients with their standard errors and verdicts."""
        return estimates(self.fit, self.said, self.coloured)

    @property
    def findings(self) -> list[Finding]:
        """Warnings: a search that did not converge, runs that are not explained, coefficients at a bound."""
        found = []
        if not self.fit.converged:
            what = f"the fit did not converge: {self._ending()}"
            found.append(Finding("not-converged", "warning", self.where, what, "start closer, or try another --method"))
        found += self.assessment.findings(self.where)
        for name, side in self.fit.at_bound.items():
            value = f"{name} = {self.fit.values[name]:.6g} is at its {side} bound"
            remedy = "widen the bound, or fix the coefficient; errors of others hold with it there"
            found.append(Finding("at-bound", "warning", self.where, value, remedy))
        return found

    def _ending(self) -> str:
        away = float(self.fit.gradient_norm)
        distance = f" It is {away:.2g} standard errors from the optimum." if math.isfinite(away) else ""
        return f"{RESULTS[self.fit.result]}{distance}".rstrip(".")

    def channel_table(self) -> Cells:
        """Heads and rows of the channels' residuals and tests."""
        heads = ("channel", "samples", "rms/σ", "p of size", "p of whiteness", "p of spikes", "predictable", "verdict")
        return heads, [self._channel(channel) for channel in self.assessment.channels]

    def _channel(self, channel: ChannelResidual) -> Sequence[str]:
        p_value = lambda p: "none" if p is None else f"{p:.2g}" if p >= 1e-12 else "< 1e-12"
        oversized, coloured, spiky = self.assessment.oversized, self.assessment.coloured, self.assessment.spiky
        rejected = (("too large", oversized), ("coloured", coloured), ("spikes", spiky))
        rms = "none" if channel.rms is None else f"{channel.rms:.3g}"
        size = p_value(channel.size) if channel.known else "σ estimated"
        share = f"{channel.predicted:.0%}"
        verdict = ", ".join(word for word, found in rejected if channel in found) or "as noise"
        tests = size, p_value(channel.white), p_value(channel.spikes)
        return channel.channel, str(channel.samples), rms, *tests, share, verdict

    def coefficient_table(self) -> Cells:
        """Heads and rows of the coefficients."""
        heads = ("coefficient", "value", "standard error", "if residuals were white", "unit", "verdict")
        error = lambda value: "none" if value is None else f"{value:.2g}"
        rows: list[Sequence[str]] = [
            (e.name, f"{e.value:.6g}", error(e.standard_error), error(e.standard_error_white), unit(e.unit), e.verdict)
            for e in self.estimates
        ]
        return heads, rows

    def sentences(self) -> list[str]:
        """What the runs identify, a line each."""
        return self.said.sentences() if self.said else ["What the recordings identify was not asked: interrupted."]

    def to_json(self) -> dict[str, Any]:
        """All of it as JSON has it."""
        fit, said = self.fit, self.said
        return {
            "schema": 1,
            "method": self.method,
            "complete": self.complete,
            "verdict": self.assessment.verdict(),
            "result": "successful" if fit.converged else RESULTS[fit.result],
            "converged": fit.converged,
            "cost": float(fit.cost),
            "gradient_norm": float(fit.gradient_norm),
            "steps": int(fit.steps),
            "fit": fit.rms,
            "assessment": self.assessment.to_json(),
            "warnings": [finding.to_json() for finding in self.findings],
            "identifiability": said
            and {
                "rank": said.rank,
                "parameters": said.parameters,
                "null_directions": said.null_directions,
                "equivalent_systems": [family.sentence() for family in said.families],
                "verdicts": said.verdicts,
            },
            "coefficients": {e.name: _without_name(e) for e in self.estimates},
        }

    def write(self, folder: Path) -> None:
        """Write `fitted.toml`, `coefficients.csv` and `identification.json` into `folder`."""
        write_vehicle(self.fit.vehicle, folder / "fitted.toml", f"fitted by jaxsub; {self.assessment.verdict()}")
        columns = ("name", "value", "standard_error", "unit", "standard_error_white", "verdict")
        with (folder / "coefficients.csv").open("w", newline="", encoding="utf-8") as file:
            table = csv.writer(file)
            table.writerow(columns)
            table.writerows([getattr(estimate, column) for column in columns] for estimate in self.estimates)
        (folder / "identification.json").write_text(to_json(self.to_json()), encoding="utf-8")


def _without_name(estimate: Estimate) -> dict[str, Any]:
    return {key: value for key, value in dataclasses.asdict(estimate).items() if key != "name"}
