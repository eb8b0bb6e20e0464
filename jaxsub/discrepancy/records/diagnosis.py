"""What a diagnosis says: plain data that the report draws and `diagnosis.json` holds."""

import dataclasses
import math
from collections.abc import Sequence
from typing import Any, Literal

import numpy as np

from ...estimate import RunValues
from ...findings import Finding
from ...vehicle import AbstractVehicle
from .decisions import Decision

Verdict = Literal["none", "named", "ambiguous", "unknown"]


@dataclasses.dataclass(frozen=True)
class Regime:
    """`variable` `above` or below a `threshold` in its SI `unit`: the mismatch is significant in the share `inside` of
    such samples, and `outside` of the others."""

    variable: str
    above: bool
    threshold: float
    inside: float
    outside: float
    unit: str = ""


@dataclasses.dataclass(frozen=True)
class Location:
    """Where the model and the recordings differ.

    `where` is an equation, `input:NAME` or `sensor:CHANNEL`; `share` of the mismatch that lies there; `times` (run,
    start s, end s) of the intervals where it is significant; `grows_with` the variables it follows, closest first;
    `regime` what those intervals have in common, if they do.
    """

    where: str
    share: float
    times: list[tuple[str, float, float]]
    grows_with: list[str]
    regime: Regime | None = None


@dataclasses.dataclass(frozen=True)
class ParameterEstimate:
    """One number with its standard error and unit, all in SI."""

    value: float
    standard_error: float
    unit: str


@dataclasses.dataclass(frozen=True)
class Rival:
    """Another explanation that was refitted: its effect, the form of it, and its probability."""

    effect: str
    label: str
    probability: float


@dataclasses.dataclass(frozen=True)
class Physics:
    """An accepted effect. `probability` is that of its name, over all of its forms.

    `trades` has other parameters whose estimates are correlated with its own, with their correlation.
    """

    effect: str
    label: str
    equations: list[str]
    expression: str
    probability: float
    parameters: dict[str, ParameterEstimate]
    rivals: list[Rival]
    trades: dict[str, float] = dataclasses.field(default_factory=dict)


@dataclasses.dataclass(frozen=True)
class Candidate:
    """One line of the score scan: how much of the residual a candidate would explain.

    `statistic` is χ² with `degrees` of freedom under "nothing left out", `p_value` is corrected for all candidates
    tried, `amplitudes` are the predicted sizes by symbol in `units`, `kept` the share of its trace that no coefficient
    can absorb, `outcome` what became of it.
    """

    effect: str
    label: str
    statistic: float
    degrees: int
    p_value: float
    amplitudes: dict[str, float]
    kept: float
    outcome: str
    units: dict[str, str] = dataclasses.field(default_factory=dict)


@dataclasses.dataclass(frozen=True)
class ForceTrace:
    """The generalised force that a model lacks in one run, by equation, at its K samples.

    **Fields**

    - `times`: (K,) s. `force`, `band`: (K,) the smoothed force and its standard deviation, N or N m, by equation.
    - `recorded`, `modelled`: (K,) the force of the effects that were added to the model, N or N m, by equation: as the
      recordings show it, and by the effects (`effect_forces`).
    - `states`: (K,) velocities, positions and actuators along the filtered trajectory, SI, by name.

    NaN is what is not known, such as states after the last interval.
    """

    run: str
    times: np.ndarray
    force: dict[str, np.ndarray]
    band: dict[str, np.ndarray]
    recorded: dict[str, np.ndarray] = dataclasses.field(default_factory=dict)
    modelled: dict[str, np.ndarray] = dataclasses.field(default_factory=dict)
    states: dict[str, np.ndarray] = dataclasses.field(default_factory=dict)


@dataclasses.dataclass(frozen=True)
class Overlay:
    """Measured and free-running modelled outputs of one run that no fit saw, by channel, SI; NaN is missing."""

    run: str
    times: np.ndarray
    measured: dict[str, np.ndarray]
    baseline: dict[str, np.ndarray]
    improved: dict[str, np.ndarray]


@dataclasses.dataclass(frozen=True)
class Remainder:
    """What a model, running free, leaves of one channel of the runs that no fit saw.

    **Fields**

    - `low`, `high`: the ends of the 95 % interval of rms(residual)/σ.
    - `samples`: how many were measured. `delays`: (L,) s, from one sample to a quarter of a run, denser where shorter.
    - `lagged`: (L,) correlation of the residual with itself so much later; `random`: how probable ones so large are in
      noise.
    - `inputs`: (2L + 1,) correlation of the residual with each signal that drives the model, from the longest delay
      after it to the longest before it, in standard errors.
    - `follows`: the input that it goes with most; `independent`: how probable so much is where it goes with none.
    """

    low: float
    high: float
    samples: int
    delays: np.ndarray
    lagged: np.ndarray
    random: float
    inputs: dict[str, np.ndarray]
    follows: str | None
    independent: float

    def to_json(self) -> dict[str, Any]:
        """What of it is a number: the interval and the two tests; null where a run diverges or nothing was measured."""
        finite = lambda value: value if math.isfinite(value) else None
        return {
            "rms_interval": [finite(self.low), finite(self.high)],
            "random_p_value": finite(self.random),
            "follows": self.follows,
            "independent_p_value": finite(self.independent),
        }


@dataclasses.dataclass(frozen=True)
class Gain:
    """The `ratio` of squared simulation errors on the test runs, improved model to baseline, and the `p_value` of so
    large a fall by chance."""

    ratio: float
    p_value: float


@dataclasses.dataclass(frozen=True)
class Explained:
    """What the effects that were found remove of the simulation error on the test runs.

    **Fields**

    - `share`: of the baseline's excess variance over the noise, what the improved model removes; None where the
      baseline leaves no significant excess, or one of the two diverges.
    - `left`: rms over the noise of the channels in which the improved model leaves significantly more than that.
      `random`: of these, what noise and the model's disturbance leave. The noise is σ, and where that is estimated the
      white part of the residuals.
    - `baseline_runs`, `improved_runs`: whether each runs through the test runs without diverging.
    """

    share: float | None
    left: dict[str, float]
    baseline_runs: bool = True
    improved_runs: bool = True
    random: dict[str, float] = dataclasses.field(default_factory=dict)


@dataclasses.dataclass(frozen=True)
class Coefficient:
    """One free number before and after; `verdict` is `identified`, `weak` (standard error above half its size), or
    `not excited` (the recordings leave it open), or `replaced` (by an effect that is another law of the same force)."""

    name: str
    unit: str
    start: float
    baseline: ParameterEstimate | None
    improved: ParameterEstimate | None
    verdict: str


@dataclasses.dataclass(frozen=True)
class ChannelQuality:
    """What the recordings are worth, channel by channel: `sigma` as stated or estimated, `record_sigma` the white part
    of the recording itself, from its differences; both SI."""

    channel: str
    unit: str
    samples: int
    missing: float
    sigma: float
    sigma_estimated: bool
    record_sigma: float


@dataclasses.dataclass(frozen=True)
class RunQuality:
    """One run: its role (`train` or `held out`), length in s, samples and sample intervals in s."""

    name: str
    role: str
    duration: float
    samples: int
    interval_median: float
    interval_max: float


@dataclasses.dataclass(frozen=True)
class Conclusions:
    """The answer to "what physics was left out", with all that shows it.

    `history` is (`baseline` or the label of the effect accepted next, held-out rms error by channel in SI). `fit` maps
    `train` and `held_out` to `baseline` and `improved` to rms(residual)/σ by channel. `p_value` is that of the whole
    mismatch, corrected for everything tried. `remains` maps `baseline` and `improved` to what each leaves of the
    held-out runs by channel, and `gain` is what the one gains over the other there. `summary` is the verdict in one
    sentence, `notes` what a reader must know besides. `explanations` are the vehicles that explain the recordings about
    as well where the verdict is `ambiguous`: the improved one, and those with a rival in the place of what is least
    certain. `kinds` is how probable it is that something is wrong with the vehicle's structure, an actuator, a sensor
    or the environment, by what was accepted and its rivals; where nothing was, by what a first look finds most of,
    which may be random forces and noise alone (`disturbance`). `file_p_value` is how probable the numbers found are
    where those of the vehicle file are right. `explained` is what the effects remove of the test runs' error, and
    `findings` is what reading and checking the recordings found, and `decisions` are all choices in order. It is
    `complete` unless its time was spent before all was tried. `by_run` are the improved model's numbers that differ by
    run, with values in the order of the training runs.
    """

    verdict: Verdict
    vehicle: str
    summary: str
    p_value: float
    where: list[Location]
    physics: list[Physics]
    fit: dict[str, dict[str, dict[str, float]]]
    candidates: list[Candidate]
    forces: list[ForceTrace]
    remaining_forces: list[ForceTrace]
    overlays: list[Overlay]
    coefficients: list[Coefficient]
    channels: list[ChannelQuality]
    runs: list[RunQuality]
    notes: list[str]
    next_manoeuvre: str | None
    kinds: dict[str, float] = dataclasses.field(default_factory=dict)
    file_p_value: float | None = None
    remains: dict[str, dict[str, Remainder]] = dataclasses.field(default_factory=dict)
    gain: Gain | None = None
    history: list[tuple[str, dict[str, float]]] = dataclasses.field(default_factory=list)
    explanations: tuple[AbstractVehicle, ...] = ()
    explained: Explained | None = None
    findings: tuple[Finding, ...] = ()
    decisions: Sequence[Decision] = ()
    complete: bool = True
    by_run: list[RunValues] = dataclasses.field(default_factory=list)

    @property
    def improves(self) -> bool:
        """Whether the improved model is another than the baseline: an effect was named, or a surrogate added."""
        return len(self.history) > 1

    @property
    def training_runs(self) -> list[str]:
        """Their names, in order."""
        return [run.name for run in self.runs if run.role == "train"]

    @property
    def quality(self) -> dict[str, ChannelQuality]:
        """What is known of each channel's noise, by the channel."""
        return {quality.channel: quality for quality in self.channels}

    def to_json(self) -> dict[str, Any]:
        """The contents of `diagnosis.json`."""
        plain = lambda estimate: dataclasses.asdict(estimate)
        where = [
            {
                "equation": place.where,
                "share": place.share,
                "times": [[start, end] for _, start, end in place.times],
                "runs": [run for run, _, _ in place.times],
                "grows_with": place.grows_with,
                "regime": dataclasses.asdict(place.regime) if place.regime else None,
            }
            for place in self.where
        ]
        physics = [
            {
                "effect": found.effect,
                "equations": found.equations,
                "expression": found.expression,
                "probability": found.probability,
                "parameters": {symbol: plain(estimate) for symbol, estimate in found.parameters.items()},
                "rivals": [{"effect": rival.effect, "probability": rival.probability} for rival in found.rivals],
                "trades_with": found.trades,
            }
            for found in self.physics
        ]
        return {
            "schema": 1,
            "complete": self.complete,
            "verdict": self.verdict,
            "summary": self.summary,
            "mismatch": {
                "p_value": self.p_value,
                "kinds": self.kinds,
                "coefficients_p_value": self.file_p_value,
                "where": where,
            },
            "physics": physics,
            "by_run": {one.name: one.to_json(self.training_runs) for one in self.by_run},
            "fit": self.fit,
            "held_out_checks": {
                model: {channel: one.to_json() for channel, one in left.items()} for model, left in self.remains.items()
            },
            "explained": self.explained.share if self.explained else None,
            "left": self.explained.left if self.explained else {},
            "held_out_gain": dataclasses.asdict(self.gain) if self.gain else None,
            "next_manoeuvre": self.next_manoeuvre,
            "decisions": [decision.to_json() for decision in self.decisions],
            "notes": self.notes,
            "warnings": [finding.to_json() for finding in self.findings],
        }
