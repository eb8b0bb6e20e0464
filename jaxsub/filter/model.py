"""What a filter needs to know of the thing it follows."""

import abc
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PyTree


class Sample(eqx.Module):
    """A sample, or with leading axes many: what drove the process since the sample before, and what was measured.

    **Fields**

    - `inputs`: whatever the process takes, SI.
    - `elapsed`: s since the sample before; zero at the first of a run and where padded: there no time passes.
    - `outputs`: (c,) measured channels, SI; `mask`: (c,) true where measured.
    - `scale`: (c,) noise of the channels relative to what the filter assumes; by default one.
    """

    inputs: PyTree[Array]
    elapsed: Float[Array, " *k"]
    outputs: Float[Array, "*k c"]
    mask: Bool[Array, "*k c"]
    scale: Float[Array, "*k c"] | None = None


class AbstractProcess(eqx.Module):
    r"""$x_k = f(x_{k-1}, \theta, u_k)$ and $z_k = h(x_k, \theta, u_k)$ with p parameters and c channels.

    $\theta$ may be empty. Both maps are differentiated by the filters. The state is n numbers with s ways to change:
    where it is a vector, n = s and a change is added to it; an attitude has a rotation for a change.
    """

    @abc.abstractmethod
    def step(self, x: Float[Array, " n"], theta: Float[Array, " p"], sample: Sample) -> Float[Array, " n"]:
        """The state at `sample`, given the state `x` (n,) at the sample before and the parameters `theta` (p,)."""

    @abc.abstractmethod
    def observe(self, x: Float[Array, " n"], theta: Float[Array, " p"], sample: Sample) -> Float[Array, " c"]:
        """The channels (c,) of `sample` at the state `x` (n,) with the parameters `theta` (p,), SI."""

    def moved(self, x: Float[Array, " n"], change: Float[Array, " s"]) -> Float[Array, " n"]:
        """The state that lies `change` from `x`."""
        return x + change

    def difference(self, x: Float[Array, " n"], origin: Float[Array, " n"]) -> Float[Array, " s"]:
        """The change from `origin` to `x`: moved(origin, difference(x, origin)) is x."""
        return x - origin

    def driven(
        self, x: Float[Array, " n"], theta: Float[Array, " p"], sample: Sample, root: Float[Array, "s m"]
    ) -> Float[Array, "s k"]:
        """A root of all that drives the state in the step from `x`: the rule's `root`, and what a process adds to it.

        `theta` (p,) are the parameters. A process that takes measured inputs of `sample` adds their noise here.
        """
        return root

    def innovation(self, measured: Float[Array, " c"], expected: Float[Array, " c"]) -> Float[Array, " c"]:
        """How far `measured` lies from `expected`; a process with angles wraps them here."""
        return measured - expected


def select(which: Bool[Array, ""], one: PyTree[Array], other: PyTree[Array]) -> PyTree[Array]:
    """All of `one` where `which` is true, else all of `other`; by leaf."""
    return jax.tree.map(lambda a, b: jnp.where(which, a, b), one, other)


def linearised(
    f: Callable[[Array, Array], Array], change: Float[Array, " s"], theta: Float[Array, " p"]
) -> tuple[Float[Array, " m"], Float[Array, "m s"], Float[Array, "m p"]]:
    """The value of `f` at a `change` (s,) of the state and at `theta` (p,), and its Jacobians by both."""
    # one argument at a time: what depends on the parameters alone, such as a matrix exponential, has no state tangents
    value, by_change = _columns(lambda change: f(change, theta), change)
    if not theta.size:
        return value, by_change, jnp.zeros((*value.shape, 0), value.dtype)
    return value, by_change, _columns(lambda theta: f(change, theta), theta)[1]


def _columns(f: Callable[[Array], Array], at: Float[Array, " q"]) -> tuple[Float[Array, " m"], Float[Array, "m q"]]:
    value, push = jax.linearize(f, at)
    return value, jax.vmap(push, out_axes=-1)(jnp.eye(at.size, dtype=at.dtype))
