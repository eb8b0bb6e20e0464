"""Fits: coefficients of a vehicle with standard errors, whether they explain the runs, and what the runs identify."""

import csv
import dataclasses
import math
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, final

import numpy as np

from ..effects import AbstractEffect
from ..errors import InputError
from ..estimate import (
    METHODS,
    AbstractMethod,
    Assessment,
    ChannelResidual,
    Passes,
    RunValues,
    Solution,
    assess,
    batch,
    posterior,
    require_free,
)
from ..estimate import fit as solve
from ..estimate.between_runs import require_runs
from ..findings import Finding
from ..information import (
    CoefficientEstimate,
    Coloured,
    Identifiability,
    Profile,
    coloured_covariance,
    estimates,
    profile,
)
from ..information import identifiability as determined
from ..plain import to_json
from ..recording import Recording
from ..recording.recording import Recordings
from ..recording.runs import Runs
from ..report.text import unit
from ..results import RESULTS
from ..vehicle import AbstractVehicle
from .recordings import checked
from .result import AbstractResult
from .stored import findings_of
from .stored_solutions import store_solution, stored_solution
from .table import Parts, Table

if TYPE_CHECKING:
    import pandas

    from ..report import Picture

DEFAULT = "gauss-newton"


def fit(vehicle: AbstractVehicle, recordings: Recordings, *, method: str | AbstractMethod = DEFAULT) -> "Fit":
    """The free coefficients of `vehicle` that make `recordings` most probable: what `jaxsub identify` computes.

    Maximum likelihood of the simulation error, with an initial state for each run and each output's noise, where the
    vehicle file leaves that open. `recordings` are one or several, checked as `js.check` does: samples that cannot be
    are masked, and a run is cut where time has a hole. `method` is one of the command's, such as `newton` or `mekf`, or
    an estimator. A search that fails is a value, `Fit.converged`, and no exception.

    **Raises** `InputError` where nothing is free, for recordings that cannot be used, for an unknown method and where
    the model does not run from the values of `vehicle`.
    """
    require_free(vehicle, vehicle.layout.name)
    runs = checked(vehicle, recordings)
    used = runs.recordings
    names = [run.name for run in used]
    found = fitted(vehicle, batch(vehicle, used).padded(), [run.source for run in used], names, method).identified()
    return dataclasses.replace(found, recordings=used, findings=runs.findings)


def identifiability(vehicle: AbstractVehicle, recordings: Recordings) -> Identifiability:
    """What `recordings` identify of the free coefficients of `vehicle`, at the fit to them: rank, verdicts, remedies.

    Takes and **raises** what `fit` does.
    """
    said = fit(vehicle, recordings).identifiability
    assert said is not None
    return said


def fitted(
    vehicle: AbstractVehicle,
    runs: Runs,
    sources: Sequence[str],
    names: Sequence[str],
    method: str | AbstractMethod,
    *,
    file: str = "",
    passes: Passes | None = None,
) -> "Fit":
    """The fit of `vehicle`, which may be from a `file`, to checked runs from `sources`, by `names`.

    `passes` is called as by `estimate.fit`. **Raises** `InputError` where the model does not run, and where one run has
    to show how much a number differs by run.
    """
    require_runs(vehicle, len(runs.times), file or vehicle.layout.name)
    found = solve(vehicle, runs, method=_estimator(method), passes=passes)
    if not np.isfinite(float(found.cost)):
        what = "the model does not run from these values"
        raise InputError(file or vehicle.layout.name, what, "give values that are closer, or another method")
    name = method if isinstance(method, str) else type(method).__name__
    return Fit(found, name, ", ".join(dict.fromkeys(sources)), assess(found), tuple(names))


def _estimator(method: str | AbstractMethod) -> AbstractMethod | None:
    """The estimator of that name; None for Gauss–Newton, which then finds a start where the file's does not run."""
    if isinstance(method, AbstractMethod) or method == DEFAULT:
        return None if isinstance(method, str) else method
    known = {name.replace("_", "-"): make for name, make in METHODS.items()}
    if method not in known:
        raise InputError("method", f"there is no {method!r}", f"choose among {', '.join(known)}")
    return known[method]()


@final
@dataclasses.dataclass(frozen=True, repr=False, eq=False)
class Fit(AbstractResult):
    """A vehicle fitted to recordings, and what follows from it.

    **Fields**

    - `solution`: where the search ended, with its statistics. `method`: the estimator's name.
    - `where`: the files or processes that made the runs. `assessment`: whether the fit explains them. `runs`: their
      names.
    - `identifiability`: what they identify. `coloured`: standard errors that allow for coloured residuals. None before
      `identified` or `completed`.
    - `recordings`: the runs as they were used. `findings`: what reading and checking found in them.
    """

    solution: Solution
    method: str
    where: str
    assessment: Assessment
    runs: tuple[str, ...] = ()
    identifiability: Identifiability | None = None
    coloured: Coloured | None = None
    recordings: tuple[Recording, ...] = ()
    findings: tuple[Finding, ...] = ()

    @classmethod
    def load(cls, folder: str | Path, effects: Sequence[type[AbstractEffect]] = ()) -> "Fit":
        """The fit that `save` wrote to `folder`; `effects` are a user's own that the vehicle has.

        **Raises** `InputError` where there is none: the command `identify` keeps no recordings, and nothing to load.
        """
        found, kept = stored_solution(Path(folder), effects)
        own, more = kept.text, {"recordings": kept.recordings, "findings": findings_of(kept.text["findings"])}
        return cls(found, own["method"], own["where"], assess(found), tuple(own["runs_used"]), **more).identified()

    @property
    def vehicle(self) -> AbstractVehicle:
        """The vehicle with the fitted coefficients."""
        return self.solution.vehicle

    @property
    def values(self) -> dict[str, float]:
        """The fitted coefficients by name, SI."""
        return self.solution.values

    @property
    def standard_errors(self) -> dict[str, float]:
        """Their standard errors, SI, if residuals were white noise of the given σ; `estimates` allow for others."""
        return self.solution.standard_errors

    @property
    def covariance(self) -> np.ndarray:
        """(p, p) covariance of the p coefficients, SI, under the same condition."""
        return np.asarray(self.solution.covariance)

    @property
    def rms(self) -> dict[str, float]:
        """rms(residual)/σ of each channel: 1 is the noise floor."""
        return self.solution.rms

    @property
    def converged(self) -> bool:
        """Whether the search ended at an optimum."""
        return self.solution.converged

    @property
    def complete(self) -> bool:
        """Whether it was asked what the runs identify, and how coloured residuals widen the standard errors."""
        return self.identifiability is not None and self.coloured is not None

    def identified(self, watch: Any = lambda share: None) -> "Fit":
        """The same with what the runs identify. `watch` is called with the share of the samples that is done."""
        said = determined(self.solution, self.assessment, watch) if self.identifiability is None else None
        return dataclasses.replace(self, identifiability=said or self.identifiability)

    def allowing_colour(self, watch: Any = lambda share: None) -> "Fit":
        """The same with standard errors that allow for coloured residuals. `watch` is called as by `identified`."""
        return dataclasses.replace(self, coloured=coloured_covariance(self.solution, None, watch))

    @cached_property
    def completed(self) -> "Fit":
        """The same with all that follows from the fit; the first such takes some seconds of compilation."""
        return self if self.complete else self.allowing_colour().identified()

    @property
    def estimates(self) -> list[CoefficientEstimate]:
        """The coefficients with units, standard errors and verdicts, by what was asked so far."""
        return estimates(self.solution, self.identifiability, self.coloured)

    @cached_property
    def variations(self) -> tuple[RunValues, ...]:
        """The numbers that differ by run: standard deviation between runs, and each run's own value."""
        return self.solution.variations

    @property
    def warnings(self) -> list[Finding]:
        """A search that did not converge, runs that are not explained, coefficients at a bound."""
        found, where = [], self.where
        if not self.converged:
            what = f"the fit did not converge: {self._ending()}"
            found.append(Finding("not-converged", "warning", where, what, "start closer, or try another method"))
        found += self.assessment.findings(where)
        for name, side in self.solution.at_bound.items():
            value = f"{name} = {self.values[name]:.6g} is at its {side} bound"
            remedy = "widen the bound, or fix the coefficient; errors of others hold with it there"
            found.append(Finding("at-bound", "warning", where, value, remedy))
        return found

    def _ending(self) -> str:
        away = float(self.solution.gradient_norm)
        distance = f" It is {away:.2g} standard errors from the optimum." if math.isfinite(away) else ""
        return f"{RESULTS[self.solution.result]}{distance}".rstrip(".")

    def brief(self) -> Parts:
        """The verdict and the coefficients."""
        return [*self._headline(), self.coefficient_table()]

    def parts(self) -> Parts:
        """The verdict, the channels, what the runs identify, and the coefficients."""
        full = self.completed
        assert full.identifiability is not None
        return full.parts_so_far()

    def parts_so_far(self) -> Parts:
        """As `parts`, of what has been computed so far."""
        said = self.identifiability
        sentences = said.sentences() if said else ["Identifiability was not computed: interrupted."]
        differing = [self.variation_table()] if self.variations else []
        sentences += [variation.sentence() for variation in self.variations]
        return [*self._headline(), self.channel_table(), *sentences, self.coefficient_table(), *differing]

    def _headline(self) -> list[str]:
        ending = [] if self.converged else [f"The fit did not converge: {self._ending()}."]
        return [*ending, f"The fit {self.assessment.verdict()}."]

    def channel_table(self) -> Table:
        """The channels' residuals and tests."""
        heads = ("channel", "samples", "rms/σ", "p of size", "p of whiteness", "p of spikes", "predictable", "verdict")
        return Table(heads, [self._channel(channel) for channel in self.assessment.channels])

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

    def coefficient_table(self) -> Table:
        """The coefficients."""
        heads = ("coefficient", "value", "standard error", "if residuals were white", "unit", "verdict")
        error = lambda value: "none" if value is None else f"{value:.2g}"
        rows = [
            (e.name, f"{e.value:.6g}", error(e.standard_error), error(e.standard_error_white), unit(e.unit), e.verdict)
            for e in self.estimates
        ]
        return Table(heads, rows)

    def variation_table(self) -> Table:
        """Each run's own value of the numbers that differ by run."""
        rows = [
            (one.name, run, f"{value:.6g}", f"{error:.2g}", unit(one.unit))
            for one in self.variations
            for run, value, error in zip(self.runs, one.values, one.errors, strict=True)
        ]
        return Table(("differs by run", "run", "value", "standard error", "unit"), rows)

    def plot(self, run: int = 0) -> "Picture":
        """The recording numbered `run` with the fit's simulation and its residuals, for the channels that fit worst."""
        from ..report import draw_run

        solution, recording = self.solution, self.recordings[run]
        shown = np.asarray(solution.runs.outputs - solution.model.error)[run, : len(recording.times)]
        return draw_run(self.vehicle, recording, shown, np.asarray(solution.sigma))

    def profile(self, names: str | Sequence[str], *, points: int = 13) -> list[Profile]:
        """The likelihood along each of the coefficients `names` at `points` values, all others fitted again.

        **Raises** `InputError` for a name that is not a free coefficient.
        """
        return profile(self.solution, [names] if isinstance(names, str) else names, points=points)

    def posterior(self, *, draws: int = 1000, warmup: int = 300, chains: int = 4, seed: int = 0) -> Any:
        """Draws from the posterior by NumPyro's no-U-turn sampler, as ArviZ has them (`estimate.posterior`).

        `draws` of each of the `chains` are kept after `warmup` others; `seed` is of all random numbers. **Raises**
        `InputError` without the packages of `jaxsub[bayes]`, and for a fit that leaves a direction open.
        """
        return posterior(self.solution, draws=draws, warmup=warmup, chains=chains, seed=seed)

    def to_dataframe(self) -> "pandas.DataFrame":
        """A row for each coefficient: value, standard errors, unit, verdict; complete."""
        import pandas

        rows = [dataclasses.asdict(estimate) for estimate in self.completed.estimates]
        return pandas.DataFrame(rows).set_index("name")

    def to_json(self) -> dict[str, Any]:
        """What `identification.json` holds."""
        solution, said = self.solution, self.identifiability
        return {
            "schema": 1,
            "method": self.method,
            "complete": self.complete,
            "verdict": self.assessment.verdict(),
            "result": "successful" if self.converged else RESULTS[solution.result],
            "converged": self.converged,
            "cost": float(solution.cost),
            "gradient_norm": float(solution.gradient_norm),
            "steps": int(solution.steps),
            "fit": self.rms,
            "assessment": self.assessment.to_json(),
            "warnings": [finding.to_json() for finding in self.warnings],
            "identifiability": said
            and {
                "rank": said.rank,
                "parameters": said.parameters,
                "null_directions": said.null_directions,
                "equivalent_systems": [family.sentence() for family in said.families],
                "verdicts": said.verdicts,
                "tied": said.tied,
            },
            "coefficients": {e.name: _without_name(e) for e in self.estimates},
            "by_run": {one.name: one.to_json(self.runs) for one in self.variations},
        }

    def write(self, folder: Path) -> None:
        """Write `fitted.toml`, `coefficients.csv` and `identification.json` into `folder`.

        A fit that has its recordings also writes `result.npz`, from which `load` makes it again.
        """
        own = {"method": self.method, "where": self.where, "runs_used": self.runs, "findings": self.findings}
        comment = f"fitted by jaxsub; {self.assessment.verdict()}"
        store_solution(self.solution, comment, folder, own, self.recordings)
        columns = ("name", "value", "standard_error", "unit", "standard_error_white", "verdict")
        with (folder / "coefficients.csv").open("w", newline="", encoding="utf-8") as file:
            table = csv.writer(file)
            table.writerow(columns)
            table.writerows([getattr(estimate, column) for column in columns] for estimate in self.estimates)
        (folder / "identification.json").write_text(to_json(self.to_json()), encoding="utf-8")


def _without_name(estimate: CoefficientEstimate) -> dict[str, Any]:
    return {key: value for key, value in dataclasses.asdict(estimate).items() if key != "name"}
