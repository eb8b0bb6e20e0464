"""Measurements that arrive after their time: the filter goes back, takes them where they belong, and catches up.

The numbers are those of a filter that had them on time. That costs a step for every sample it goes back.
"""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from .ekf import AbstractFilter, Estimate, FilterState
from .model import Sample


class Late(eqx.Module):
    """A measurement of the past, or with leading axes many.

    **Fields**

    - `outputs`: (c,) SI, `mask`: (c,) and `scale`: (c,) without a unit, as in `Sample`.
    - `age`: s before the newest sample.
    """

    outputs: Float[Array, "*k c"]
    mask: Bool[Array, "*k c"]
    scale: Float[Array, "*k c"]
    age: Float[Array, " *k"]


class Past(eqx.Module):
    """The last d samples, the newest last, each with the state before it and its time.

    **Fields**

    - `before`: d states. `samples`: d samples. `age`: (d,) s before the newest; infinite where there was none.
    - `now`: the state after the newest.
    """

    before: FilterState
    samples: Sample
    age: Float[Array, " d"]
    now: FilterState


class DelayedFilter(eqx.Module):
    """`filter`, with a memory of `depth` samples to which late measurements go back.

    A late measurement belongs to the sample that is nearest in time. One that lies beyond the memory's oldest or newest
    sample by more than half of that sample's interval, and a channel measured at its sample already, are left out.
    """

    filter: AbstractFilter
    depth: int = eqx.field(static=True)

    def start(self, state: FilterState, like: Sample) -> Past:
        """No past, from `state`; samples will have the shape of `like`, whose `scale` must be given."""
        many = lambda leaf: jnp.broadcast_to(leaf, (self.depth, *jnp.shape(leaf)))
        nothing = dataclasses.replace(jax.tree.map(jnp.zeros_like, like), scale=jnp.ones_like(like.outputs))
        before, samples = jax.tree.map(many, (state, nothing))
        return Past(before, samples, jnp.full(self.depth, jnp.inf, like.elapsed.dtype), state)

    def step(self, past: Past, sample: Sample, late: Late) -> tuple[Past, Estimate]:
        """The estimate after `sample` and all before it, `past`.

        `late` is taken at its time if its mask says that there is one.
        """
        push = lambda old, new: jnp.concatenate([old[1:], jnp.asarray(new)[None]])
        before = jax.tree.map(push, past.before, past.now)
        samples = jax.tree.map(push, past.samples, sample)
        age = push(past.age + sample.elapsed, jnp.zeros_like(sample.elapsed))
        nearest = jnp.argmin(jnp.abs(age - late.age))
        oldest = jnp.max(jnp.where(jnp.isfinite(age), age, 0.0))
        margin = 0.5 * samples.elapsed[nearest]
        # neither holds for an age that is no number
        known = (late.age <= oldest + margin) & (late.age >= -margin)
        added = _with(jax.tree.map(lambda leaf: leaf[nearest], samples), late, known)
        samples = jax.tree.map(lambda old, new: old.at[nearest].set(new), samples, added)
        first = jnp.where(jnp.any(late.mask) & known, nearest, self.depth - 1)
        return self._replayed(before, samples, age, first)

    def _replayed(
        self, before: FilterState, samples: Sample, age: Float[Array, " d"], first: Array
    ) -> tuple[Past, Estimate]:
        """All samples from number `first` on, taken again."""
        state = jax.tree.map(lambda leaf: leaf[first], before)
        pick = lambda index: jax.tree.map(lambda leaf: leaf[index], samples)
        shape = jax.eval_shape(self.filter.step, state, pick(0))[1]
        nothing = jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), shape)

        def one(index: Array, carry: tuple[FilterState, FilterState, Estimate]):
            before, state, _ = carry
            before = jax.tree.map(lambda old, new: old.at[index].set(new), before, state)
            return before, *self.filter.step(state, pick(index))

        before, now, estimate = jax.lax.fori_loop(first, self.depth, one, (before, state, nothing))
        return Past(before, samples, age, now), estimate


def _with(sample: Sample, late: Late, known: Bool[Array, ""]) -> Sample:
    """`sample` with the channels of `late` that it lacks."""
    new = late.mask & ~sample.mask & known
    assert sample.scale is not None
    outputs = jnp.where(new, late.outputs, sample.outputs)
    return dataclasses.replace(
        sample, outputs=outputs, mask=sample.mask | new, scale=jnp.where(new, late.scale, sample.scale)
    )
