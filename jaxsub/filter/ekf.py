r"""The extended Kalman filter of the augmented vector $[x, \theta]$, the parameters taken as constant.

On-line, `on_line` compiles `step` for one sample at a time; off-line, `passes.over_runs` scans the same `step`.
"""

import abc
import dataclasses
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.scipy.linalg import block_diag
from jaxtyping import Array, Bool, Float

from .form import AbstractForm, SquareRoot
from .model import AbstractProcess, Sample, linearised
from .noise import AbstractNoiseRule, Residuals


class FilterState(eqx.Module):
    """What a filter carries from sample to sample.

    **Fields**

    - `x`: (s,) state. `theta`: (p,) parameters.
    - `joint`: what the filter's form keeps of the uncertainty of [x, θ]; `own`: of x were θ known, where it has that.
    - `memory`, `residuals`: of the process-noise rule.
    - `diverged`: whether a number ceased to be finite. The filter then stays at its last finite numbers.
    """

    x: Float[Array, " s"]
    theta: Float[Array, " p"]
    joint: Float[Array, "q q"]
    own: Float[Array, "s s"] | None
    memory: Any
    residuals: Residuals
    diverged: Bool[Array, ""]


class Estimate(eqx.Module):
    """What a filter knows after a sample.

    **Fields**

    - `x`, `theta`: estimates; `x_std`, `theta_std`: their standard deviations.
    - `innovation`: (c,) measured minus predicted, zero where missing; `factor`: (c, c) lower-triangular factor of its
      covariance, parameters' uncertainty included: the whitened innovation is factor⁻¹ innovation.
    - `diverged`: as in `FilterState`.
    """

    x: Float[Array, "*k s"]
    theta: Float[Array, "*k p"]
    x_std: Float[Array, "*k s"]
    theta_std: Float[Array, "*k p"]
    innovation: Float[Array, "*k c"]
    factor: Float[Array, "*k c c"]
    diverged: Bool[Array, " *k"]


class AbstractFilter(eqx.Module):
    """Follows a process and its parameters.

    **Fields**

    - `process`: what it follows. `noise`: how far the state may stray from it.
    - `R_root`: (c, c) lower Cholesky factor of the measurement noise's covariance.
    - `x_root`: (s, s) square root of the covariance of a run's initial state.
    - `form`: how uncertainty is kept.
    """

    process: eqx.AbstractVar[AbstractProcess]
    noise: eqx.AbstractVar[AbstractNoiseRule]
    R_root: eqx.AbstractVar[Float[Array, "c c"]]
    x_root: eqx.AbstractVar[Float[Array, "s s"]]
    form: eqx.AbstractVar[AbstractForm]

    @abc.abstractmethod
    def own(self) -> Float[Array, "s s"] | None:
        """What is kept at the start of a run of the uncertainty of the state were the parameters known."""

    @abc.abstractmethod
    def predict(self, state: FilterState, sample: Sample, G: Float[Array, "s m"]) -> FilterState:
        """Across the interval before `sample`, with process noise of covariance G Gᵀ."""

    @abc.abstractmethod
    def correct(self, state: FilterState, sample: Sample) -> tuple[FilterState, Float[Array, "c c"]]:
        """By what was measured, and the factor of the innovation's covariance."""

    def start(self, x: Float[Array, " s"], theta: Float[Array, " p"], theta_root: Float[Array, "p p"]) -> FilterState:
        """Before the first sample; `theta_root` is a square root of the parameters' covariance."""
        joint = self.form.start(block_diag(self.x_root, theta_root))
        residuals = Residuals.none(x, self.R_root)
        diverged = jnp.zeros((), bool)
        return _strong(FilterState(x, theta, joint, self.own(), self.noise.start(), residuals, diverged))

    def restart(self, state: FilterState, x: Float[Array, " s"]) -> FilterState:
        """Before the first sample of another run: the state starts anew, the parameters and their covariance stay."""
        joint, residuals = self.form.restart(self.x_root, state.joint), Residuals.none(x, self.R_root)
        return _strong(FilterState(x, state.theta, joint, self.own(), self.noise.start(), residuals, state.diverged))

    def step(self, state: FilterState, sample: Sample) -> tuple[FilterState, Estimate]:
        """The next state and what is known after `sample`."""
        memory, G = self.noise(state.memory, state.residuals, sample.elapsed)
        moved = dataclasses.replace(self.predict(state, sample, G), memory=memory)
        after, factor = self.correct(_select(sample.elapsed > 0.0, moved, state), sample)
        finite = jnp.stack([jnp.all(jnp.isfinite(leaf)) for leaf in jax.tree.leaves(after)])
        sound = jnp.all(finite) & ~state.diverged
        after = dataclasses.replace(_select(sound, after, state), diverged=~sound)
        s = after.x.size
        deviations = self.form.deviations(after.joint)
        innovation, factor = after.residuals.innovation, jnp.where(sound, factor, self.R_root)
        return after, Estimate(after.x, after.theta, deviations[:s], deviations[s:], innovation, factor, after.diverged)


def on_line(filter: AbstractFilter) -> Callable[[FilterState, Sample], tuple[FilterState, Estimate]]:
    """`filter.step`, compiled at the first sample; the filter's own numbers are part of the program."""
    return jax.jit(lambda state, sample: filter.step(state, sample))


class ExtendedKalmanFilter(AbstractFilter):
    r"""Linearises $[f(x,\theta), \theta]$ and h about its own estimates.

    Source: Ljung (1979), IEEE Trans. Automatic Control 24, on why it may be biased or diverge.
    """

    process: AbstractProcess
    noise: AbstractNoiseRule
    R_root: Float[Array, "c c"]
    x_root: Float[Array, "s s"]
    form: AbstractForm = SquareRoot()

    def own(self) -> None:
        """There is one filter only."""
        return None

    def predict(self, state: FilterState, sample: Sample, G: Float[Array, "s m"]) -> FilterState:
        """The augmented step."""
        x, joint, _ = augmented_predict(self, state, sample, G)
        return dataclasses.replace(state, x=x, joint=joint)

    def correct(self, state: FilterState, sample: Sample) -> tuple[FilterState, Float[Array, "c c"]]:
        """The augmented update."""
        s = state.x.size
        innovation, C = observed(self, state, sample)
        gain, factor, joint = self.form.update(state.joint, C, self.R_root, sample.mask)
        change = gain @ innovation
        residuals = Residuals(innovation, sample.mask, factor, gain[:s], change[:s])
        x, theta = state.x + change[:s], state.theta + change[s:]
        return dataclasses.replace(state, x=x, theta=theta, joint=joint, residuals=residuals), factor


def augmented_predict(
    filter: AbstractFilter, state: FilterState, sample: Sample, G: Float[Array, "s m"]
) -> tuple[Float[Array, " s"], Float[Array, "q q"], Float[Array, "s s"]]:
    """The next state, what is kept of the uncertainty of [x, θ], and the Jacobian of the step by the state."""
    p = state.theta.size
    x, F, by_theta = linearised(lambda x, theta: filter.process.step(x, theta, sample), state.x, state.theta)
    whole = jnp.block([[F, by_theta], [jnp.zeros_like(by_theta.T), jnp.eye(p, dtype=F.dtype)]])
    noise = jnp.concatenate([G, jnp.zeros((p, G.shape[1]), G.dtype)])
    return x, filter.form.predict(state.joint, whole, noise), F


def observed(
    filter: AbstractFilter, state: FilterState, sample: Sample
) -> tuple[Float[Array, " c"], Float[Array, "c q"]]:
    """The innovation, zero where missing, and the Jacobian of the outputs by [x, θ]."""
    process = filter.process
    expected, C, by_theta = linearised(lambda x, theta: process.observe(x, theta, sample), state.x, state.theta)
    innovation = jnp.where(sample.mask, process.innovation(sample.outputs, expected), 0.0)
    return innovation, jnp.concatenate([C, by_theta], axis=1)


def _strong(state: FilterState) -> FilterState:
    """`state` without the weak type of Python numbers, with which a step would be compiled for twice."""
    return jax.tree.map(lambda leaf: jnp.asarray(leaf, leaf.dtype), state)


def _select(which: Bool[Array, ""], one: FilterState, other: FilterState) -> FilterState:
    return jax.tree.map(lambda a, b: jnp.where(which, a, b), one, other)
