"""A submerged body with physics that its filter does not know: where and when the process noise rises.

NPS AUV II runs for two minutes; from 40 to 80 s an effect of the vocabulary acts that the filter's vehicle is without.
The same is asked of the normalised innovations squared (NIS) of a filter with constant noise.
"""

import dataclasses
from pathlib import Path
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from jaxtyping import Array
from scipy import stats

from jaxsub.discrepancy.explain.process_noise import LEVEL, Above, calibrated, noise_densities, noise_filter
from jaxsub.effects import (
    VELOCITIES,
    AbstractForce,
    Facts,
    HullAsymmetry,
    Motion,
    PropellerTorque,
    QuadraticDamping,
    Signal,
    with_numbers,
)
from jaxsub.filter import samples
from jaxsub.parameters import number
from jaxsub.recording import Recording
from jaxsub.recording.runs import Runs, stack_runs
from jaxsub.simulation import at_rest, prbs, sampled_states, simulate
from jaxsub.simulation.sampled import measure
from jaxsub.vehicle import SubmergedBody
from jaxsub.vehicle.catalogue import nps_auv_ii

SAMPLES, INTERVAL, EVENT = 600, 0.2, (40.0, 80.0)
TIMES = INTERVAL * np.arange(SAMPLES)
ACTS = (EVENT[0] <= TIMES) & ~(EVENT[1] <= TIMES)
# with them the velocity of the equation itself moves by some 10, 6, 22, 2, 2 and 2 sigmas
EFFECTS: dict[str, AbstractForce] = {
    "sway damping": QuadraticDamping("sway", number(-4000.0)),
    "yaw damping": QuadraticDamping("yaw", number(-30000.0)),
    "thrust loss": HullAsymmetry("surge", number(-60.0)),
    "heave force": HullAsymmetry("heave", number(150.0)),
    "roll torque": PropellerTorque("constant", number(80.0)),
    "pitch moment": HullAsymmetry("pitch", number(300.0)),
}
_SHOWN = ("sway damping", "thrust loss", "heave force")
_SIZES = {"whole": 1.0, "third": 1.0 / 3.0}
_COPIES, _CLEAN_TESTS = 19, 8


class During(AbstractForce):
    """A force that acts while the recorded surroundings say so."""

    name: ClassVar[str] = "during"
    family: ClassVar[str] = "experiment"
    inner: AbstractForce

    @classmethod
    def candidates(cls, facts: Facts) -> "list[During]":
        """None: no diagnosis knows of it."""
        return []

    @property
    def where(self) -> tuple[str, ...]:
        """The force's equations."""
        return self.inner.where

    @property
    def expression(self) -> str:
        """The force's term."""
        return self.inner.expression

    def force(self, motion: Motion) -> dict[str, Signal]:
        """The force, or zero."""
        acts = motion.environment["acts"]
        return {equation: acts * force for equation, force in self.inner.force(motion).items()}


class Found(NamedTuple):
    """A detector's ratios of many runs, (R, K, n), and each run's threshold, (R,)."""

    ratio: np.ndarray
    threshold: np.ndarray


def run(out: Path, quick: bool) -> dict:
    """Which equation is first, how the times overlap, and how often a clean run raises an alarm."""
    out.mkdir(parents=True, exist_ok=True)
    vehicle, count = nps_auv_ii(), 6 if quick else 20
    sigma = jnp.array([output.sigma for output in vehicle.layout.outputs])
    inputs = recorded(vehicle, {}, count)
    cases = {(name, size): {name: scale} for name in EFFECTS for size, scale in _SIZES.items()}
    # one batch, so that one program is compiled
    missing = joined([recorded(vehicle, sizes, count) for sizes in cases.values()])
    copies = _COPIES + _CLEAN_TESTS
    results: dict = {"runs": count, "copies": _COPIES, "false_alarm": {}, "effects": {name: {} for name in EFFECTS}}
    for detector, statistic in {"fuzzy_q": noise_densities, "nis_constant": innovation_squares}.items():
        # the last of the copies play the part of recordings
        clean = np.asarray(statistic(vehicle, inputs, at_rest(vehicle, count), sigma, noise(inputs, copies))[0])
        every = np.asarray(
            statistic(vehicle, missing, at_rest(vehicle, len(missing.times)), sigma, noise(missing, 0))[1]
        )
        results["false_alarm"][detector] = false_alarm(clean)
        found = {}
        for case, part in zip(cases, np.split(every, len(cases)), strict=True):
            name, size = case
            found[case] = against(clean[:_COPIES], part)
            judged = score(found[case], EFFECTS[name], vehicle.layout.equations)
            results["effects"][name].setdefault(size, {})[detector] = judged
        if detector == "fuzzy_q":
            shown = {name: found[name, "whole"] for name in _SHOWN}
            draw(shown, clean, vehicle.layout.equations, out / "submerged_process_noise.png")
    return results


def noise(runs: Runs, copies: int) -> np.ndarray:
    """(m, R, K, c) noise of unit size for so many `copies` of the runs."""
    return np.random.default_rng(0).standard_normal((copies, *runs.outputs.shape))


def joined(parts: list[Runs]) -> Runs:
    """Batches of runs of the same times as one batch."""
    together = lambda *leaves: jnp.concatenate(leaves)
    fields = ("times", "step_of", "live", "signals", "outputs", "mask")
    return dataclasses.replace(parts[0], **{f: together(*(getattr(part, f) for part in parts)) for f in fields})


def recorded(vehicle: SubmergedBody, sizes: dict[str, float], count: int) -> Runs:
    """What `vehicle` would have recorded with effects of so many times their size, a run a seed of inputs and noise."""
    layout = vehicle.layout
    driven = [driving(vehicle, seed) for seed in range(count)]
    truth = dataclasses.replace(vehicle, layout=dataclasses.replace(layout, environment=(("acts", "acts"),)))
    for name, effect in EFFECTS.items():
        # every effect is there, at some size, so that one program simulates all
        scaled = {k: sizes.get(name, 0.0) * getattr(effect, k) for k in effect.symbols()}
        truth = truth.with_effect(During(with_numbers(effect, scaled)))
    stack = lambda columns: stack_runs(driven, held=layout.held, interpolated=columns, channels=layout.channels)
    runs = stack(("acts",))
    shown = np.asarray(measure(truth, runs, sampled_states(truth, runs, at_rest(vehicle, len(driven)))))
    sigma = np.array([output.sigma for output in layout.outputs])
    own = np.stack([np.random.default_rng([7, seed]).normal(size=shown.shape[1:]) for seed in range(count)])
    return dataclasses.replace(stack(()), outputs=jnp.asarray(shown + sigma * own), mask=jnp.ones(shown.shape, bool))


def driving(vehicle: SubmergedBody, seed: int) -> Recording:
    """Rudder and elevators as random telegraph signals."""
    columns = {name: np.full(SAMPLES, np.nan) for name in vehicle.layout.channels} | {"acts": ACTS.astype(float)}
    fins = (("delta_r", 25, 0.25), ("delta_er", 20, 0.12), ("delta_el", 20, 0.12))
    columns |= {name: prbs(SAMPLES, hold, size, 1000 * seed + i) for i, (name, hold, size) in enumerate(fins)}
    return Recording(f"run {seed}", TIMES, columns, "experiment")


@eqx.filter_jit
def innovation_squares(
    vehicle: SubmergedBody, runs: Runs, start: Array, sigma: Array, draws: Array
) -> tuple[Array, Array]:
    """Squares of the velocities' normalised innovations with constant noise, as `noise_densities` gives densities."""
    outputs = jnp.concatenate([simulate(vehicle, runs, start) + sigma * draws, runs.outputs[None]])
    adaptive = noise_filter(vehicle, runs.substeps, sigma)
    assert isinstance(adaptive.noise, Above)
    constant = dataclasses.replace(adaptive, noise=adaptive.noise.constant)
    channels = jnp.array([vehicle.layout.channels.index(VELOCITIES[e]) for e in vehicle.layout.equations])

    def follow(x, sequence):
        def step(state, sample):
            after, estimate = constant.step(state, sample)
            return after, (estimate.innovation**2 / jnp.sum(estimate.factor**2, axis=1))[channels]

        return jax.lax.scan(step, constant.start(x, jnp.zeros(0), jnp.zeros((0, 0))), sequence)[1]

    every = lambda z: jax.vmap(follow)(start, samples(dataclasses.replace(runs, outputs=z)))
    squares = jax.vmap(every)(outputs)
    return squares[:-1], squares[-1]


def against(clean: np.ndarray, density: np.ndarray) -> Found:
    """Every run against the clean copies of itself."""
    lengths = np.array([SAMPLES])
    pairs = [calibrated(clean[:, i : i + 1], density[i : i + 1], lengths) for i in range(len(density))]
    return Found(np.concatenate([ratio for ratio, _ in pairs]), np.array([threshold for _, threshold in pairs]))


def false_alarm(density: np.ndarray) -> dict:
    """How often a clean run is above its threshold anywhere, with the 95 % Clopper-Pearson interval."""
    alarms = 0
    for extra in density[_COPIES:]:
        found = against(density[:_COPIES], extra)
        alarms += int(np.sum(found.ratio.max(axis=(1, 2)) > found.threshold))
    tests = (len(density) - _COPIES) * density.shape[1]
    interval = stats.binomtest(alarms, tests).proportion_ci(0.95)
    return {
        "stated": LEVEL,
        "rate": alarms / tests,
        "of": tests,
        "interval": [float(interval.low), float(interval.high)],
    }


def score(found: Found, effect: AbstractForce, equations: tuple[str, ...]) -> dict:
    """Rates over runs: the equation's own ratio is the highest; it is above the threshold; IoU of its times."""
    own = equations.index(effect.where[0])
    above = found.ratio[:, :, own] > found.threshold[:, None]
    overlap = np.sum(above & ACTS, axis=1) / np.sum(above | ACTS, axis=1)
    return {
        "first": float(np.mean(np.argmax(found.ratio.max(axis=1), axis=1) == own)),
        "above_threshold": float(np.mean(above.any(axis=1))),
        "iou": {f"p{q}": float(np.percentile(overlap, q)) for q in (5, 50, 95)},
        "peak_over_threshold": float(np.median(found.ratio[:, :, own].max(axis=1) / found.threshold)),
    }


def draw(traces: dict[str, Found], clean: np.ndarray, equations: tuple[str, ...], path: Path) -> None:
    """Q_ii over its clean mean, by equation and effect: the clean band, the runs with missing physics, and when."""
    calm = [against(clean[:_COPIES], extra).ratio for extra in clean[_COPIES:]]
    low, high = np.percentile(np.concatenate(calm), (5, 95), axis=0)
    live = TIMES >= 5.0
    figure, grid = plt.subplots(len(equations), len(_SHOWN), figsize=(11, 11), sharex=True, sharey=True)
    for column, name in enumerate(_SHOWN):
        ratio, threshold = traces[name]
        for row, equation in enumerate(equations):
            axes = grid[row, column]
            axes.axvspan(*EVENT, color="0.9", lw=0)
            axes.fill_between(TIMES[live], low[live, row], high[live, row], color="tab:blue", alpha=0.45, lw=0)
            part = np.percentile(ratio[:, live, row], (5, 50, 95), axis=0)
            axes.fill_between(TIMES[live], part[0], part[2], color="tab:red", alpha=0.25, lw=0)
            axes.plot(TIMES[live], part[1], color="tab:red", lw=1.2)
            axes.axhline(np.median(threshold), color="0.3", lw=0.8, ls="--")
            axes.set_yscale("log")
            axes.set_ylim(0.2, 60.0)
            if column == 0:
                axes.set_ylabel(f"{equation}\nfuzzy $Q_{{ii}}$ / clean")
        grid[0, column].set_title(f"{name} (in {EFFECTS[name].where[0]})")
        grid[-1, column].set_xlabel("time, s")
    figure.suptitle("Fuzzy process noise over that of clean runs: 5–95 % clean (blue) and with physics missing (red)")
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    plt.close(figure)
