r"""When, and in which equation, a filter needs more process noise than its model: missing physics as a filter feels it.

An extended Kalman filter with all coefficients known follows each run. Its noise has a constant density $Q_0$ and on
top of it the fuzzy rule's $|\Delta x_i\,\Delta\dot x_i|$. Without $Q_0$ the rule falls asleep: the gain is small, so
are the corrections, and with them Q. The rule's part over that of clean simulations of the same vehicle on the same
inputs, both averaged over some seconds, is near one where the model is right, at any time and in any equation.

Source: the second paper, eq. 18; the threshold is a Monte-Carlo test's (Barnard 1963, J. Royal Stat. Soc. B 25).
"""

import dataclasses
from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from ...arrays import Values
from ...effects import AbstractActuator
from ...estimate import Solution
from ...filter import (
    AbstractNoiseRule,
    ConstantNoise,
    Covariance,
    ExtendedKalmanFilter,
    FilterState,
    FuzzyNoise,
    Residuals,
    Sample,
    VehicleProcess,
    samples,
    state_scale,
)
from ...programs import compiled
from ...recording import Recording
from ...recording.runs import Runs
from ...simulation import simulate
from ...vehicle import AbstractVehicle

_SEED = 0
# level of an alarm anywhere in clean runs, of which 19 copies are the fewest that show it
LEVEL = 0.05
# constant process noise, sensors' σ per root second: with less the filter's uncertainty is slow to follow, with more it
# corrects so much at once that a small force drowns in the sensors' noise
_FLOOR = 0.1
# least and most of the process noise on top of it, in the same unit
_RANGE = (1e-4, 10.0)
# samples over which the process noise is averaged
_WINDOW = 50
# initial states, in units of their own
_START_STD = 10.0


@dataclasses.dataclass(frozen=True)
class NoiseSignal:
    """How the process noise of one run compares with that of clean simulations.

    **Fields**

    - `times`: (k,) s on the recording's clock. `window`: s over which densities are averaged.
    - `std`: by equation, (k,) root of the density of Q_ii, state units per root second.
    - `ratio`: by equation, (k,) the rule's part of Q_ii, averaged, over that of clean simulations at the same time.
    - `threshold`: of the ratio; clean recordings exceed it anywhere, in any equation or run, at the rate `LEVEL`.
    """

    run: str
    times: np.ndarray
    window: float
    std: dict[str, np.ndarray]
    ratio: dict[str, np.ndarray]
    threshold: float

    def rises(self, equation: str, times: np.ndarray) -> np.ndarray:
        """At which of `times` (j,) the ratio of an equation is above the threshold, (j,) booleans."""
        return np.interp(times, self.times, self.ratio[equation]) > self.threshold

    def intervals(self, equation: str) -> list[tuple[float, float]]:
        """Start and end (s) of the times above the threshold; gaps shorter than the averaging window are closed."""
        above = self.times[self.ratio[equation] > self.threshold]
        if not above.size:
            return []
        cuts = np.flatnonzero(np.diff(above) > self.window) + 1
        return [(float(part[0]), float(part[-1])) for part in np.split(above, cuts)]

    def ranked(self) -> list[str]:
        """Equations above the threshold at some time, the highest ratio first."""
        peak = {equation: float(np.max(ratio)) for equation, ratio in self.ratio.items()}
        return sorted((e for e in peak if peak[e] > self.threshold), key=lambda e: -peak[e])


def noise_signals(fit: Solution, recordings: Sequence[Recording], copies: int = 19) -> list[NoiseSignal]:
    """The signal of each run of a fit, calibrated on clean `copies` of all runs, of which 19 are the fewest.

    None where no filter can follow: a vehicle with an effect on an actuator, a run on which the filter
    diverges, or one too short for it to settle.
    """
    vehicle = fit.vehicle
    if any(isinstance(effect, AbstractActuator) for effect in vehicle.effects):
        return []
    # by NumPy: to compile a generator of random numbers takes seconds
    draws = np.random.default_rng(_SEED).standard_normal((copies, *fit.runs.outputs.shape))
    densities = noise_densities(vehicle, fit.runs, fit.start, fit.sigma, draws)
    clean, recorded = (np.asarray(density) for density in densities)
    lengths = np.asarray(fit.runs.live).sum(1) + 1
    if not (np.isfinite(clean).all() and np.isfinite(recorded).all() and lengths.min() > _WINDOW // 2):
        return []
    ratios, threshold = calibrated(clean, recorded, lengths)
    std = np.sqrt(recorded + floor(vehicle, np.asarray(fit.sigma)) ** 2)
    signals = []
    for run, recording in enumerate(recordings):
        k, window = int(lengths[run]), _WINDOW * float(np.median(np.diff(recording.times)))
        of = lambda values, run=run, k=k: dict(zip(vehicle.layout.equations, values[run, :k].T, strict=True))
        signals.append(NoiseSignal(recording.name, recording.times, window, of(std), of(ratios), threshold))
    return signals


def noise_note(signals: Sequence[NoiseSignal]) -> list[str]:
    """One line: the equations and times where the filter's process noise rises; none without signals."""
    if not signals:
        return []
    clean = f"clean runs do so anywhere with probability {LEVEL:g}"
    risen = [
        f"{equation} ({signal.run}: {', '.join(f'{a:.0f} to {b:.0f} s' for a, b in signal.intervals(equation))})"
        for signal in signals
        for equation in signal.ranked()
    ]
    if not risen:
        return [f"The filter's process noise rises in no equation; {clean}."]
    return [f"The filter's process noise rises in {'; '.join(risen)}; {clean}."]


def calibrated(
    clean: Float[np.ndarray, "m r k n"], recorded: Float[np.ndarray, "r k n"], lengths: np.ndarray
) -> tuple[Float[np.ndarray, "r k n"], float]:
    """Averaged densities over the mean of the clean ones, and the threshold that clean runs cross at `LEVEL`.

    `lengths` (r,) are the samples of each run.
    """
    place = np.arange(recorded.shape[1])
    # until then the filter settles
    live = (place < lengths[:, None]) & (place >= _WINDOW // 2)
    copies = _averaged(clean, live)
    together = copies.sum(axis=0)
    # a copy counts not among those that it is held against, as the recording does not
    others = np.maximum((together - copies) / (len(copies) - 1), 1e-300)
    highest = np.sort(np.max(copies / others, axis=(1, 2, 3), where=live[..., None], initial=0.0))
    # were the recording clean, it would be as likely as any copy to be the highest
    rank = int(np.ceil((1.0 - LEVEL) * (len(copies) + 1) - 1e-9))
    ratios = _averaged(recorded[None], live)[0] / np.maximum(together / len(copies), 1e-300)
    return np.where(live[..., None], ratios, 0.0), float(highest[rank - 1])


def _averaged(density: Float[np.ndarray, "m r k n"], live: Bool[np.ndarray, "r k"]) -> Float[np.ndarray, "m r k n"]:
    """The mean of what is live over a centred window, which is shorter at the ends of a run."""
    place = np.arange(density.shape[2])
    first, last = np.maximum(place - _WINDOW // 2, 0), np.minimum(place + _WINDOW // 2, len(place))

    def window(values: np.ndarray) -> np.ndarray:
        sums = np.concatenate([np.zeros_like(values[:, :, :1]), np.cumsum(values, axis=2)], axis=2)
        return sums[:, :, last] - sums[:, :, first]

    weight = live[None, :, :, None].astype(float)
    return window(density * weight) / np.maximum(window(weight), 1.0)


class Above(AbstractNoiseRule):
    """The noise of a `rule` on top of `constant` noise."""

    constant: ConstantNoise
    rule: AbstractNoiseRule

    def start(self) -> Any:
        """The rule's memory."""
        return self.rule.start()

    def __call__(self, memory: Any, residuals: Residuals, elapsed: Float[Array, ""]) -> tuple[Any, Float[Array, "s m"]]:
        """Both roots side by side: the covariances add."""
        _, beneath = self.constant((), residuals, elapsed)
        memory, root = self.rule(memory, residuals, elapsed)
        return memory, jnp.concatenate([beneath, root], axis=1)


def noise_filter(vehicle: AbstractVehicle, substeps: int, sigma: Float[Array, " c"]) -> ExtendedKalmanFilter:
    """The extended Kalman filter of a vehicle whose numbers are all known, with fuzzy noise above a constant one."""
    known = vehicle.holding(vehicle.values())
    scale = jnp.asarray(state_scale(known, sigma))
    constant = ConstantNoise(jnp.diag(_FLOOR * scale))
    least, most = _RANGE
    rule = Above(constant, FuzzyNoise(least * scale, most * scale))
    # the start that a fit found has missing physics in it: the filter takes its own from the first samples
    begin = jnp.diag(_START_STD * scale)
    # updated by covariances, whose program compiles in three quarters of the time
    return ExtendedKalmanFilter(VehicleProcess.of(known, substeps), rule, jnp.diag(sigma), begin, Covariance())


def floor(vehicle: AbstractVehicle, sigma: Float[Values, " c"]) -> Float[Values, " n"]:
    """Root of the constant density beneath the rule's, of each equation."""
    return _FLOOR * state_scale(vehicle, sigma)[: len(vehicle.layout.equations)]


def noise_densities(
    vehicle: AbstractVehicle,
    runs: Runs,
    start: Float[Array, "r s"],
    sigma: Float[Array, " c"],
    draws: Float[Values, "m r k c"],
) -> tuple[Float[Array, "m r k n"], Float[Array, "r k n"]]:
    """The rule's part of Q_ii a second of the n equations, for m clean copies of R runs and for the runs themselves.

    `start` is the state at each run's first sample, `sigma` the sensors' noise, both SI, and `draws` the copies' noise
    in units of it; NaN once a filter diverged.
    """
    return _densities(vehicle, runs, start, sigma, simulate(vehicle, runs, start), draws)


@compiled
def _densities(
    vehicle: AbstractVehicle, runs: Runs, start: Array, sigma: Array, clean: Array, draws: Values
) -> tuple[Float[Array, "m r k n"], Float[Array, "r k n"]]:
    """`noise_densities` by the `clean` outputs (R, K, c), which a program of their own gives."""
    outputs = jnp.concatenate([clean + sigma * draws, runs.outputs[None]])
    filter, beneath = noise_filter(vehicle, runs.substeps, sigma), floor(vehicle, sigma)

    def step(state: FilterState, sample: Sample) -> tuple[FilterState, Array]:
        after, estimate = filter.step(state, sample)
        whole = estimate.noise_std[: beneath.size] ** 2 / jnp.where(sample.elapsed > 0.0, sample.elapsed, 1.0)
        return after, jnp.where(estimate.diverged, jnp.nan, jnp.maximum(whole - beneath**2, 0.0))

    def follow(x: Array, sequence: Sample) -> Array:
        begin = filter.start(x, jnp.zeros(0, x.dtype), jnp.zeros((0, 0), x.dtype))
        return jax.lax.scan(step, begin, sequence)[1]

    every = lambda z: jax.vmap(follow)(start, samples(dataclasses.replace(runs, outputs=z)))
    density = jax.vmap(every)(outputs)
    return density[:-1], density[-1]
