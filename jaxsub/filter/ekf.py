r"""The extended Kalman filter of the augmented vector $[x, \theta]$, the parameters taken as constant.

On-line, `on_line` compiles `step` for one sample at a time; off-line, `passes.over_runs` scans the same `step`.
"""

import abc
import dataclasses
import math
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.scipy.linalg import block_diag
from jaxtyping import Array, Bool, Float, Int

from ..methods import jittable
from .form import AbstractForm, SquareRoot
from .gate import AbstractGate, Open
from .model import AbstractProcess, Sample, linearised, select
from .noise import AbstractNoiseRule, Innovation, Residuals


class FilterState(eqx.Module):
    """What a filter carries from sample to sample.

    **Fields**

    - `x`: (n,) state, SI, of s ways to change. `theta`: (p,) parameters, in their coordinates.
    - `joint`: (q, q) covariance of [x, θ], q = s + p, or its root, as the filter's form keeps it.
    - `own`: (s, s) the same of x, SI, were θ known; None where the filter has no such.
    - `memory`, `residuals`: of the process-noise rule.
    - `outside`: (c,) how often each channel was outside the gate in a row, in agreement; `rejected`: (c,) innovation
      of the last that was, SI.
    - `diverged`: whether a number ceased to be finite. The filter then stays at its last finite numbers.
    """

    x: Float[Array, " n"]
    theta: Float[Array, " p"]
    joint: Float[Array, "q q"]
    own: Float[Array, "s s"] | None
    memory: Any
    residuals: Residuals
    outside: Int[Array, " c"]
    rejected: Float[Array, " c"]
    diverged: Bool[Array, ""]


class Estimate(eqx.Module):
    """What a filter knows after a sample.

    **Fields**

    - `x`: (n,) estimated state, SI; `x_std`: (s,) standard deviations of its changes, SI.
    - `theta`, `theta_std`: (p,) estimated parameters, in their coordinates, and their standard deviations.
    - `innovation`: (c,) measured minus predicted, SI, zero where missing or rejected; `factor`: (c, c) lower-triangular
      factor of its covariance, parameters' uncertainty included: the whitened innovation is factor⁻¹ innovation.
    - `used`: (c,) true where measured and believed. `noise_std`: (s,) root of the process noise's variance in the
      interval before.
    - `diverged`: as in `FilterState`.
    """

    x: Float[Array, "*k n"]
    theta: Float[Array, "*k p"]
    x_std: Float[Array, "*k s"]
    theta_std: Float[Array, "*k p"]
    innovation: Float[Array, "*k c"]
    factor: Float[Array, "*k c c"]
    used: Bool[Array, "*k c"]
    noise_std: Float[Array, "*k s"]
    diverged: Bool[Array, " *k"]

    @property
    def innovation_std(self) -> Float[Array, "*k c"]:
        """(c,) standard deviations of the innovations."""
        return jnp.linalg.norm(self.factor, axis=-1)


class AbstractFilter(eqx.Module):
    """Follows a process and its parameters.

    **Fields**

    - `process`: what it follows. `noise`: how far the state may stray from it.
    - `R_root`: (c, c) lower Cholesky factor of the measurement noise's covariance.
    - `x_root`: (s, s) square root of the covariance of a run's initial state.
    - `form`: how uncertainty is kept. `gate`: which measurements are believed.
    """

    process: eqx.AbstractVar[AbstractProcess]
    noise: eqx.AbstractVar[AbstractNoiseRule]
    R_root: eqx.AbstractVar[Float[Array, "c c"]]
    x_root: eqx.AbstractVar[Float[Array, "s s"]]
    form: eqx.AbstractVar[AbstractForm]
    gate: eqx.AbstractVar[AbstractGate]

    @abc.abstractmethod
    def own(self) -> Float[Array, "s s"] | None:
        """What is kept at the start of a run of the uncertainty of the state were the parameters known."""

    @abc.abstractmethod
    def predict(self, state: FilterState, sample: Sample, G: Float[Array, "s m"]) -> FilterState:
        """`state` across the interval before `sample`, with process noise of covariance G Gᵀ."""

    @abc.abstractmethod
    def widened(self, state: FilterState, G: Float[Array, "s m"]) -> FilterState:
        """`state` with process noise of covariance G Gᵀ added, at the same time."""

    @abc.abstractmethod
    def correct(self, state: FilterState, seen: Innovation) -> tuple[FilterState, Float[Array, "c c"]]:
        """`state` corrected by the innovation `seen`, and the factor of the innovation's covariance."""

    def start(self, x: Float[Array, " n"], theta: Float[Array, " p"], theta_root: Float[Array, "p p"]) -> FilterState:
        """The filter's state before the first sample, of the state `x` (n,) and the parameters `theta` (p,), SI.

        `theta_root` (p, p) is a square root of the parameters' covariance.
        """
        joint = self.form.start(block_diag(self.x_root, theta_root))
        return self._begun(x, theta, joint, jnp.zeros((), bool))

    def restart(self, state: FilterState, x: Float[Array, " n"]) -> FilterState:
        """Before the first sample of another run: the `state` starts at `x` (n,), SI.

        The parameters and their covariance stay.
        """
        return self._begun(x, state.theta, self.form.restart(self.x_root, state.joint), state.diverged)

    def _begun(
        self, x: Float[Array, " n"], theta: Float[Array, " p"], joint: Float[Array, "q q"], diverged: Bool[Array, ""]
    ) -> FilterState:
        residuals = Residuals.none(self.x_root, self.R_root)
        outside, rejected = jnp.zeros(len(self.R_root), int), jnp.zeros(len(self.R_root), x.dtype)
        begun = FilterState(x, theta, joint, self.own(), self.noise.start(), residuals, outside, rejected, diverged)
        return _strong(begun)

    def before(self, state: FilterState, sample: Sample) -> tuple[FilterState, Innovation, Float[Array, "s m"]]:
        """The state at `sample` before it is corrected, what the sample shows, and a root of the noise on the way."""
        memory, root = self.noise(state.memory, state.residuals, sample.elapsed)
        moves = sample.elapsed > 0.0
        driven = self.process.driven(state.x, state.theta, sample, root)
        if not isinstance(self.gate, Open):
            driven = jnp.concatenate([driven, jnp.where(self._begins_anew(state, sample), self.x_root, 0.0)], axis=1)
        G = jnp.where(moves, driven, 0.0)
        moved = dataclasses.replace(self.predict(state, sample, G), memory=memory)
        before = select(moves, moved, state)
        before, seen = self._look(before, sample)
        surprise = self.noise.surprise(before.memory, seen)
        if surprise is not None:
            memory, more = surprise
            before = dataclasses.replace(self.widened(before, more), memory=memory)
            G = jnp.concatenate([G, more], axis=1)
        return before, seen, G

    @jittable
    def step(self, state: FilterState, sample: Sample) -> tuple[FilterState, Estimate]:
        """The next state and what is known after `sample`."""
        return self.corrected(state, *self.before(state, sample))

    def corrected(
        self, state: FilterState, before: FilterState, seen: Innovation, G: Float[Array, "s m"]
    ) -> tuple[FilterState, Estimate]:
        """The next state and the estimate, of the `state` before a sample and its prediction `before` for that sample.

        `seen` is the innovation, and G Gᵀ with `G` (s, m) the covariance of the process noise.
        """
        after, factor = self.correct(before, seen)
        finite = jnp.stack([jnp.all(jnp.isfinite(leaf)) for leaf in jax.tree.leaves(after)])
        sound = jnp.all(finite) & ~state.diverged
        after = dataclasses.replace(select(sound, after, state), diverged=~sound)
        s = len(self.x_root)
        deviations = self.form.deviations(after.joint)
        innovation, factor = jnp.where(sound, seen.value, 0.0), jnp.where(sound, factor, self.R_root)
        noise_std = jnp.where(sound, jnp.linalg.norm(G, axis=1), 0.0)
        parts = (after.x, after.theta, deviations[:s], deviations[s:], innovation, factor, seen.mask & sound)
        return after, Estimate(*parts, noise_std, after.diverged)

    def _begins_anew(self, state: FilterState, sample: Sample) -> Bool[Array, ""]:
        """Whether a channel has just used up the gate's patience: the state is then as uncertain as at the start."""
        return jnp.any(sample.mask & (state.outside > 0) & (state.outside == self.gate.patience))

    def _look(self, state: FilterState, sample: Sample) -> tuple[FilterState, Innovation]:
        """What `sample` shows, what the gate rejects left out, and what the gate has seen so far."""
        process = self.process
        ways = jnp.zeros(len(self.x_root), state.x.dtype)
        observe = lambda change, theta: process.observe(process.moved(state.x, change), theta, sample)
        expected, by_change, by_theta = linearised(observe, ways, state.theta)
        C = jnp.concatenate([by_change, by_theta], axis=1)
        R_root = self.R_root if sample.scale is None else sample.scale[:, None] * self.R_root
        innovation = process.innovation(sample.outputs, expected)
        covariance = self.form.seen(state.joint, C) + R_root @ R_root.T
        deviations = jnp.sqrt(jnp.diag(covariance))
        inside, patient = self.gate.inside(innovation, deviations), state.outside < self.gate.patience
        mask = sample.mask & (inside | ~patient)
        # of two measurements that err independently the difference has twice the variance
        agrees = self.gate.inside(process.innovation(innovation, state.rejected), math.sqrt(2.0) * deviations)
        longer = jnp.where(agrees | ~patient, state.outside + 1, 1)
        outside = jnp.where(sample.mask, jnp.where(inside, 0, longer), state.outside)
        rejected = jnp.where(sample.mask & ~inside, innovation, state.rejected)
        after = dataclasses.replace(state, outside=outside, rejected=rejected)
        return after, Innovation(jnp.where(mask, innovation, 0.0), mask, C, R_root, covariance)


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
    gate: AbstractGate = Open()

    def own(self) -> None:
        """There is one filter only."""
        return None

    def predict(self, state: FilterState, sample: Sample, G: Float[Array, "s m"]) -> FilterState:
        """The augmented step."""
        x, joint, _ = augmented_predict(self, state, sample, G)
        return dataclasses.replace(state, x=x, joint=joint)

    def widened(self, state: FilterState, G: Float[Array, "s m"]) -> FilterState:
        """The parameters gather none of it."""
        return dataclasses.replace(state, joint=augmented_widened(self, state, G))

    def correct(self, state: FilterState, seen: Innovation) -> tuple[FilterState, Float[Array, "c c"]]:
        """The augmented update."""
        s = len(self.x_root)
        gain, factor, joint = self.form.update(state.joint, seen.C, seen.R_root, seen.mask)
        change = gain @ seen.value
        residuals = Residuals(seen.value, seen.mask, factor, gain[:s], change[:s])
        x, theta = self.process.moved(state.x, change[:s]), state.theta + change[s:]
        return dataclasses.replace(state, x=x, theta=theta, joint=joint, residuals=residuals), factor


def augmented_predict(
    filter: AbstractFilter, state: FilterState, sample: Sample, G: Float[Array, "s m"]
) -> tuple[Float[Array, " n"], Float[Array, "q q"], Float[Array, "s s"]]:
    """The next state, what is kept of the uncertainty of [x, θ], and the Jacobian of the step by the state."""
    process, s, p = filter.process, len(filter.x_root), state.theta.size
    after = lambda change, theta: process.step(process.moved(state.x, change), theta, sample)
    x, *jacobians = linearised(after, jnp.zeros(s, state.x.dtype), state.theta)
    # of the state's n numbers; of its ways to change
    push = jax.linearize(lambda moved: process.difference(moved, x), x)[1]
    by_all = jax.vmap(push, 1, 1)(jnp.concatenate(jacobians, axis=1))
    # The parameters' columns are not sliced off: with no parameters that is an empty slice of a concatenation, at which
    # XLA's front end on one core drops the calling convention of every LAPACK routine in the program.
    whole = jnp.concatenate([by_all, jnp.eye(p, s + p, k=s, dtype=by_all.dtype)])
    return x, filter.form.predict(state.joint, whole, _of_state(G, p)), by_all[:, :s]


def augmented_widened(filter: AbstractFilter, state: FilterState, G: Float[Array, "s m"]) -> Float[Array, "q q"]:
    """What is kept of the uncertainty of [x, θ] with that of G in x added."""
    q = len(state.joint)
    return filter.form.predict(state.joint, jnp.eye(q, dtype=G.dtype), _of_state(G, state.theta.size))


def _of_state(G: Float[Array, "s m"], p: int) -> Float[Array, "q m"]:
    """Noise of x as noise of [x, θ]."""
    return jnp.concatenate([G, jnp.zeros((p, G.shape[1]), G.dtype)])


def _strong(state: FilterState) -> FilterState:
    """`state` without the weak type of Python numbers, with which a step would be compiled for twice."""
    return jax.tree.map(lambda leaf: jnp.asarray(leaf, leaf.dtype), state)
