r"""The Rauch-Tung-Striebel smoother of a filter's run, block by block, so that memory grows with the states at blocks.

With $F_k$ the Jacobian of the step, $P_k$ the filter's covariance and $P^-_{k+1}$ the predicted one,
$C_k = P_kF_k^T(P^-_{k+1})^{-1}$, $\hat x^s_k = \hat x_k + C_k(\hat x^s_{k+1} - \hat x^-_{k+1})$ and
$P^s_k = P_k + C_k(P^s_{k+1} - P^-_{k+1})C_k^T$. Differences are changes of the state (`AbstractProcess.difference`).
Source: Rauch, Tung and Striebel (1965), AIAA J. 3.
"""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from ..programs import compiled
from .ekf import AbstractFilter, FilterState
from .model import Sample, linearised
from .small import backward, forward


class Smoothed(eqx.Module):
    """A state given all samples, or with a leading axis many.

    **Fields**

    - `x`: (n,) state, SI. `covariance`: (s, s) of its changes, SI.
    """

    x: Float[Array, "*k n"]
    covariance: Float[Array, "*k s s"]


class _Passed(eqx.Module):
    """What the backward pass needs of a step: the filter's state before it, and the prediction it was corrected from.

    **Fields**

    - `x`, `P`: after the sample before. `ahead`, `root`: the prediction at this sample and a root of its covariance.
    - `C`: the smoother's gain.
    """

    x: Float[Array, " n"]
    P: Float[Array, "s s"]
    ahead: Float[Array, " n"]
    root: Float[Array, "s s"]
    C: Float[Array, "s s"]


def last(filter: AbstractFilter, state: FilterState) -> Smoothed:
    """The estimate after the last sample, from the `state` of `filter`, from which a backward pass begins."""
    s = len(filter.x_root)
    return Smoothed(state.x, filter.form.covariance(state.joint)[:s, :s])


@compiled
def smooth_block(
    filter: AbstractFilter,
    begin: FilterState,
    samples: Sample,
    after: Smoothed,
    shown: Callable[[Smoothed, Sample], PyTree[Array]],
) -> tuple[Smoothed, PyTree[Array]]:
    """The backward pass over K samples; the filter's forward pass over them is done again from the state at `begin`.

    `after` is the smoothed state at the last of the samples. What comes back is that at `begin`, for the block before,
    and what is `shown` of the smoothed state at each of the samples. The filter has no parameters.
    """

    def ahead(state: FilterState, sample: Sample) -> tuple[FilterState, _Passed]:
        before, seen, G = filter.before(state, sample)
        P = filter.form.covariance(state.joint)
        F = _jacobian(filter, state, sample)
        root = filter.form.factor(before.joint)
        C = backward(root, forward(root, F @ P)).T
        return filter.corrected(state, before, seen, G)[0], _Passed(state.x, P, before.x, root, C)

    def back(known: Smoothed, passed: tuple[_Passed, Sample]) -> tuple[Smoothed, PyTree[Array]]:
        process, (step, sample) = filter.process, passed
        change = process.difference(known.x, step.ahead)
        x = process.moved(step.x, step.C @ change)
        wide = known.covariance - step.root @ step.root.T
        P = step.P + step.C @ wide @ step.C.T
        return Smoothed(x, 0.5 * (P + P.T)), shown(known, sample)

    passed = jax.lax.scan(ahead, begin, samples)[1]
    return jax.lax.scan(back, after, (passed, samples), reverse=True)


def _jacobian(filter: AbstractFilter, state: FilterState, sample: Sample) -> Float[Array, "s s"]:
    """Of the change of the state across the interval before `sample`; the identity where no time passes."""
    process, s = filter.process, len(filter.x_root)
    following = process.step(state.x, state.theta, sample)
    change = lambda ways, theta: process.difference(
        process.step(process.moved(state.x, ways), theta, sample), following
    )
    F = linearised(change, jnp.zeros(s, state.x.dtype), state.theta)[1]
    return jnp.where(sample.elapsed > 0.0, F, jnp.eye(s, dtype=F.dtype))
