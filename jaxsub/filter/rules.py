r"""Process-noise rules that a filter is usually run with when its noise is not known.

All give a root of Q, so that Q is positive semi-definite whatever a rule has learnt. Where a rule learns variances
$Q_{ii}$ it learns densities, per second, and keeps them within limits: a filter without process noise believes its
model more and more and stops listening, and one bad measurement must not make it forget all it knows.
"""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, UInt32

from .noise import AbstractNoiseRule, Residuals


class RandomNoise(AbstractNoiseRule):
    r"""$Q_{ii} = (r_i u)^2$ a second, u uniform in [0, 1): the second paper's conventional filter.

    **Fields**

    - `largest`: (s,) $r_i$, state units per root second.
    - `key`: (2,) raw key of the random numbers, `jax.random.key_data` of one.
    """

    largest: Float[Array, " s"]
    key: UInt32[Array, "2"]

    def start(self) -> UInt32[Array, "2"]:
        """The key."""
        return self.key

    def __call__(
        self, memory: UInt32[Array, "2"], residuals: Residuals, elapsed: Float[Array, ""]
    ) -> tuple[UInt32[Array, "2"], Float[Array, "s s"]]:
        """A fresh draw for every interval."""
        following, drawn = jax.random.split(jax.random.wrap_key_data(memory))
        root = self.largest * jax.random.uniform(drawn, self.largest.shape, self.largest.dtype)
        return jax.random.key_data(following), jnp.diag(root * jnp.sqrt(elapsed))


class Clock(eqx.Module):
    """Time since the measurement before; what a rule learns from a measurement belongs to that time.

    **Fields**

    - `since`: s since the last measurement that the rule has seen.
    """

    since: Float[Array, ""]

    @classmethod
    def start(cls, like: Float[Array, " s"]) -> "Clock":
        """No time has passed."""
        return cls(jnp.zeros((), like.dtype))

    def heard(self, residuals: Residuals) -> tuple[Bool[Array, ""], Float[Array, ""]]:
        """Whether the last sample held a measurement, after some time; and how long that time was, never zero."""
        fresh = jnp.any(residuals.mask) & (self.since > 0.0)
        return fresh, jnp.where(fresh, self.since, 1.0)

    def on(self, residuals: Residuals, elapsed: Float[Array, ""]) -> "Clock":
        """After the next `elapsed` seconds."""
        return Clock(jnp.where(jnp.any(residuals.mask), 0.0, self.since) + elapsed)


class Learnt(eqx.Module):
    """The memory of a rule that learns densities.

    **Fields**

    - `density`: (s,) variance per second. `clock`: since the last measurement.
    """

    density: Float[Array, " s"]
    clock: Clock


class SageHusaNoise(AbstractNoiseRule):
    r"""The diagonal of $Q \leftarrow Q + d\,[K\nu\nu^TK^T - KSK^T]$ with $d = (1-b)/(1-b^{k+1})$ in the limit $1-b$.

    Sage and Husa's $K\nu\nu^TK^T + P^+ - \Phi P\Phi^T$ with $P^+ = P^- - KSK^T$ and $P^- = \Phi P\Phi^T + Q$: at rest
    where innovations are as large as the filter says.

    **Fields**

    - `first`: (s,) root of the density to begin with, state units per root second.
    - `least`, `most`: (s,) its limits, in the same units.
    - `forgetting`: b, the weight of all that was learnt before.

    Source: Sage and Husa (1969), Joint Automatic Control Conference.
    """

    first: Float[Array, " s"]
    least: Float[Array, " s"]
    most: Float[Array, " s"]
    forgetting: float = 0.97

    def start(self) -> Learnt:
        """The first density."""
        return Learnt(self.first**2, Clock.start(self.first))

    def __call__(
        self, memory: Learnt, residuals: Residuals, elapsed: Float[Array, ""]
    ) -> tuple[Learnt, Float[Array, "s s"]]:
        """The density learnt so far over the time elapsed."""
        fresh, since = memory.clock.heard(residuals)
        surplus = residuals.correction**2 - jnp.sum((residuals.gain @ residuals.factor) ** 2, axis=1)
        learnt = memory.density + (1.0 - self.forgetting) * surplus / since
        density = jnp.where(fresh, jnp.clip(learnt, self.least**2, self.most**2), memory.density)
        return Learnt(density, memory.clock.on(residuals, elapsed)), jnp.diag(jnp.sqrt(density) * jnp.sqrt(elapsed))


class Window(eqx.Module):
    """The last w measurements a rule has seen, the newest last.

    **Fields**

    - `values`: (w, k) zero where there was none yet. `times`: (w,) s; `held`: (w,) true where there was one.
    - `now`: s.
    """

    values: Float[Array, "w k"]
    times: Float[Array, " w"]
    held: Bool[Array, " w"]
    now: Float[Array, ""]

    @classmethod
    def start(cls, width: int, like: Float[Array, " k"]) -> "Window":
        """Nothing seen yet."""
        kind = like.dtype
        return cls(
            jnp.zeros((width, like.size), kind), jnp.zeros(width, kind), jnp.zeros(width, bool), jnp.zeros((), kind)
        )

    def with_newest(self, value: Float[Array, " k"], fresh: Bool[Array, ""]) -> "Window":
        """After `value`, if it is a `fresh` one; times count from the oldest that is left, so that they stay small."""
        add = lambda old, new: jnp.where(fresh, jnp.concatenate([old[1:], new[None]]), old)
        seen = Window(add(self.values, value), add(self.times, self.now), add(self.held, fresh), self.now)
        oldest = jnp.min(jnp.where(seen.held, seen.times, seen.now))
        return dataclasses.replace(seen, times=jnp.where(seen.held, seen.times - oldest, 0.0), now=seen.now - oldest)

    def on(self, elapsed: Float[Array, ""]) -> "Window":
        """After the next `elapsed` seconds."""
        return dataclasses.replace(self, now=self.now + elapsed)


class InnovationNoise(AbstractNoiseRule):
    r"""$Q = K\hat C_\nu K^T$ with $\hat C_\nu$ the mean of $\nu\nu^T$ over the last w measurements.

    A density is made of it by the mean time between those measurements: two stamps that nearly coincide then make no
    storm of noise. Each channel's mean is over the measurements that had it.

    **Fields**

    - `least`: (s,) root of the least density, state units per root second; until the first innovation it is all.
    - `channels`, `width`: of the measurement, and of the window.

    Source: Mohamed and Schwarz (1999), Adaptive Kalman filtering for INS/GPS, J. Geodesy 73, eq. 26 in steady state.
    """

    least: Float[Array, " s"]
    channels: int = eqx.field(static=True)
    width: int = eqx.field(static=True, default=15)

    def start(self) -> tuple[Window, Clock, Float[Array, "s w"]]:
        """An empty window, of innovations, which channels they had, and the time before each."""
        kind = self.least.dtype
        root = jnp.zeros((self.least.size, self.width), kind)
        return Window.start(self.width, jnp.zeros(2 * self.channels + 1, kind)), Clock.start(self.least), root

    def __call__(
        self, memory: tuple[Window, Clock, Float[Array, "s w"]], residuals: Residuals, elapsed: Float[Array, ""]
    ) -> tuple[tuple[Window, Clock, Float[Array, "s w"]], Float[Array, "s k"]]:
        """K [ν₁ … ν_w]/√w, whose square is K Ĉ Kᵀ, beside what its diagonal is short of the least density."""
        window, clock, root = memory
        fresh, since = clock.heard(residuals)
        window = window.with_newest(jnp.concatenate([residuals.innovation, residuals.mask, since[None]]), fresh)
        innovations, had, before = jnp.split(window.values, (self.channels, 2 * self.channels), axis=1)
        interval = jnp.sum(before) / jnp.maximum(jnp.sum(window.held), 1)
        weight = jnp.maximum(jnp.sum(had, axis=0), 1.0) * jnp.where(fresh, interval, 1.0)
        root = jnp.where(fresh, residuals.gain @ (innovations / jnp.sqrt(weight)).T, root)
        # what is short of the least and not the least itself: added to every Q it would grow in the loop with the gain
        short = self.least**2 - jnp.sum(root**2, axis=1)
        filling = jnp.where(short > 0.0, jnp.sqrt(jnp.where(short > 0.0, short, 1.0)), 0.0)
        whole = jnp.concatenate([root, jnp.diag(filling)], axis=1) * jnp.sqrt(elapsed)
        return (window.on(elapsed), clock.on(residuals, elapsed), root), whole
