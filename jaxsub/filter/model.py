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

    - `inputs`: whatever the process takes.
    - `elapsed`: s since the sample before; zero at the first of a run and where padded: there no time passes.
    - `outputs`: (c,) measured channels; `mask`: (c,) true where measured.
    """

    inputs: PyTree[Array]
    elapsed: Float[Array, " *k"]
    outputs: Float[Array, "*k c"]
    mask: Bool[Array, "*k c"]


class AbstractProcess(eqx.Module):
    r"""$x_k = f(x_{k-1}, \theta, u_k)$ and $z_k = h(x_k, \theta, u_k)$ with s states, p parameters and c channels.

    $\theta$ may be empty. Both maps are differentiated by the filters.
    """

    @abc.abstractmethod
    def step(self, x: Float[Array, " s"], theta: Float[Array, " p"], sample: Sample) -> Float[Array, " s"]:
        """The state at `sample`, given the state at the sample before."""

    @abc.abstractmethod
    def observe(self, x: Float[Array, " s"], theta: Float[Array, " p"], sample: Sample) -> Float[Array, " c"]:
        """What the sensors show."""

    def innovation(self, measured: Float[Array, " c"], expected: Float[Array, " c"]) -> Float[Array, " c"]:
        """How far `measured` lies from `expected`; a process with angles wraps them here."""
        return measured - expected


def linearised(
    f: Callable[[Array, Array], Array], x: Float[Array, " s"], theta: Float[Array, " p"]
) -> tuple[Float[Array, " m"], Float[Array, "m s"], Float[Array, "m p"]]:
    """The value of `f` at (x, θ) and its Jacobians by x and by θ."""
    # one argument at a time: what depends on the parameters alone, such as a matrix exponential, has no state tangents
    value, by_x = _columns(lambda x: f(x, theta), x)
    return value, by_x, _columns(lambda theta: f(x, theta), theta)[1]


def _columns(f: Callable[[Array], Array], at: Float[Array, " q"]) -> tuple[Float[Array, " m"], Float[Array, "m q"]]:
    value, push = jax.linearize(f, at)
    if not at.size:
        return value, jnp.zeros((*value.shape, 0), value.dtype)
    return value, jax.vmap(push, out_axes=-1)(jnp.eye(at.size, dtype=at.dtype))
