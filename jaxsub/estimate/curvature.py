"""A cost's curvature, and what a damped step over it takes: all of it by eigenvalues, or by parts that do not touch."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.custom_batching import sequential_vmap
from jaxtyping import Array, Bool, Float, Shaped

# a direction with less of the curvature than this is rounding, and says nothing
_FLAT = 1e-13
_NEGATIVE = -1e-6


class Arrow(eqx.Module):
    r"""Of p parameters and the initial states of R runs, which feel the parameters and not each other.

    $\begin{pmatrix} A & B_r \\ B_r^T & \mathrm{diag}(C_r)\end{pmatrix}$, positive semidefinite with positive definite
    $C_r$. A step takes R solves of s numbers and one of p, so its cost is linear in the runs and not cubic.

    **Fields**

    - `among`: A, (p, p). `mixed`: B, (R, p, s). `own`: C, (R, s, s).
    """

    among: Float[Array, "p p"]
    mixed: Float[Array, "r p s"]
    own: Float[Array, "r s s"]

    def dense(self) -> Float[Array, "d d"]:
        """All of it, d = p + R s."""
        mixed = jnp.moveaxis(self.mixed, 0, 1).reshape(len(self.among), -1)
        return jnp.block([[self.among, mixed], [mixed.T, jax.scipy.linalg.block_diag(*self.own)]])

    def diagonal(self) -> Float[Array, " d"]:
        """Its diagonal."""
        return jnp.concatenate([jnp.diag(self.among), jnp.diagonal(self.own, axis1=1, axis2=2).ravel()])

    def over(self, size: Float[Array, " d"]) -> "Arrow":
        """In coordinates `size` times larger."""
        shared, own = self._split(size)
        across = shared[:, None] * own[:, None, :]
        return Arrow(
            self.among / jnp.outer(shared, shared), self.mixed / across, self.own / (own[..., None] * own[:, None, :])
        )

    def times(self, vector: Float[Array, " d"]) -> Float[Array, " d"]:
        """Its product with a vector."""
        shared, own = self._split(vector)
        after = jnp.einsum("rps,p->rs", self.mixed, shared) + jnp.einsum("rst,rt->rs", self.own, own)
        return jnp.concatenate([self.among @ shared + jnp.einsum("rps,rs->p", self.mixed, own), after.ravel()])

    def without(self, held: Bool[Array, " d"]) -> "Arrow":
        """Of the coordinates that are not `held`; those stand alone, with a curvature of one."""
        shared, own = self._split(held)
        mixed = jnp.where(shared[:, None] | own[:, None, :], 0.0, self.mixed)
        return Arrow(decoupled(self.among, shared), mixed, jax.vmap(decoupled)(self.own, own))

    def solve(self, vector: Float[Array, " d"], damping: Array) -> Float[Array, " d"]:
        """What it, with `damping` on its diagonal, takes to `vector`."""
        left, right, through, own = self._eliminated(vector, damping)
        shared = jnp.linalg.solve(left, right)
        return jnp.concatenate([shared, (own - through @ shared).ravel()])

    def gain(self, gradient: Float[Array, " d"]) -> Float[Array, ""]:
        r"""$\tfrac12 g^TH^{-1}g$, less what lies in unidentifiable directions."""
        left, right, _, own = self._eliminated(gradient, jnp.zeros(()))
        values, vectors = eigh(left)
        # what was taken off is exact to the rounding of a diagonal of ones
        curved = values > _FLAT * jnp.maximum(jnp.max(values, initial=0.0), 1.0)
        squares = jnp.where(curved, (vectors.T @ right) ** 2 / jnp.where(curved, values, 1.0), 0.0)
        return 0.5 * (jnp.sum(self._split(gradient)[1] * own) + jnp.sum(squares))

    def _split(self, vector: Shaped[Array, " d"]) -> tuple[Shaped[Array, " p"], Shaped[Array, "r s"]]:
        p = len(self.among)
        return vector[:p], vector[p:].reshape(self.own.shape[:2])

    def _eliminated(self, vector: Float[Array, " d"], damping: Array) -> tuple[Array, Array, Array, Array]:
        """The parameters' own system once the initial states are eliminated: matrix (p, p) and right side (p,).

        With what the initial states follow the parameters by (R, s, p), and would be without them (R, s).
        """
        shared, own = self._split(vector)
        damped = self.own + damping * jnp.eye(self.own.shape[1])
        beside = jnp.concatenate([jnp.swapaxes(self.mixed, 1, 2), own[..., None]], axis=-1)
        found = jnp.linalg.solve(damped, beside)
        through, alone = found[..., :-1], found[..., -1]
        left = self.among + damping * jnp.eye(len(shared)) - jnp.einsum("rps,rsq->pq", self.mixed, through)
        return left, shared - jnp.einsum("rps,rs->p", self.mixed, alone), through, alone


class Spectrum(eqx.Module):
    r"""The eigenvalues and vectors of a curvature of any kind; steps take it by their absolute values $|H|$.

    So a step goes downhill where the curvature is indefinite too.
    """

    values: Float[Array, " d"]
    vectors: Float[Array, "d d"]

    def times(self, vector: Float[Array, " d"]) -> Float[Array, " d"]:
        """The product of |H| with a vector."""
        return self.vectors @ (jnp.abs(self.values) * (self.vectors.T @ vector))

    def without(self, held: Bool[Array, " d"]) -> "Spectrum":
        """Of the coordinates that are not `held`; those stand alone, with a curvature of one."""
        return Spectrum(*eigh(decoupled((self.vectors * self.values) @ self.vectors.T, held)))

    def solve(self, vector: Float[Array, " d"], damping: Array) -> Float[Array, " d"]:
        """What |H|, with `damping` on its diagonal, takes to `vector`."""
        return self.vectors @ ((self.vectors.T @ vector) / (jnp.abs(self.values) + damping))

    def gain(self, gradient: Float[Array, " d"]) -> Float[Array, ""]:
        r"""$\tfrac12 g^T|H|^{-1}g$, less what lies in unidentifiable directions.

        Infinite where the curvature is not that of a minimum: there is more to gain than a full step promises.
        """
        size = jnp.abs(self.values)
        curved = size > _FLAT * jnp.max(size, initial=0.0)
        full = 0.5 * jnp.sum(jnp.where(curved, (self.vectors.T @ gradient) ** 2 / jnp.where(curved, size, 1.0), 0.0))
        return jnp.where(self.negative, jnp.inf, full)

    @property
    def negative(self) -> Bool[Array, ""]:
        """Whether it bends down somewhere."""
        return jnp.any(self.values < _NEGATIVE)


def decoupled(matrix: Float[Array, "d d"], held: Bool[Array, " d"]) -> Float[Array, "d d"]:
    """A matrix with ones on the diagonal, and zeros beside them, where coordinates are `held`."""
    return jnp.where(held[:, None] | held, jnp.diag(held.astype(matrix.dtype)), matrix)


@sequential_vmap
def eigh(matrix: Float[Array, "d d"]) -> tuple[Float[Array, " d"], Float[Array, "d d"]]:
    """Eigenvalues and vectors, of a batch one after the other.

    jaxlib 0.10 gives each worker of XLA's pool a part of a batch and waits on one of them for the others: two programs
    at a time, a thread for each core, then wait for each other without end.
    """
    return tuple(jnp.linalg.eigh(matrix))


def over_unit_diagonal(
    curvature: Arrow | Float[Array, "d d"],
) -> tuple[Arrow | Spectrum, Float[Array, " d"]]:
    """A curvature in coordinates in which its diagonal is one, and their sizes; where it has none they stay."""
    diagonal = curvature.diagonal() if isinstance(curvature, Arrow) else jnp.diag(curvature)
    size = jnp.where(diagonal == 0.0, 1.0, jnp.sqrt(jnp.abs(diagonal)))
    if isinstance(curvature, Arrow):
        return curvature.over(size), size
    return Spectrum(*eigh(curvature / jnp.outer(size, size))), size
