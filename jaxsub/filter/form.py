"""How a filter keeps what it does not know: as a square root, which stays positive definite, or as a covariance."""

import abc
from typing import Literal

import equinox as eqx
import jax.numpy as jnp
from jax.scipy.linalg import block_diag
from jaxtyping import Array, Bool, Float

from .small import cholesky, times
from .square_root import by_qr, by_svd, covariance_update, stacked, update


class AbstractForm(eqx.Module):
    """An (n, n) array that stands for a covariance, and what time and measurements do to it."""

    @abc.abstractmethod
    def start(self, root: Float[Array, "n n"]) -> Float[Array, "n n"]:
        """What stands for the covariance of the square root `root`."""

    @abc.abstractmethod
    def covariance(self, kept: Float[Array, "n n"]) -> Float[Array, "n n"]:
        """The covariance that `kept` stands for."""

    @abc.abstractmethod
    def factor(self, kept: Float[Array, "n n"]) -> Float[Array, "n n"]:
        """The lower-triangular root of the covariance P that `kept` (n, n) stands for."""

    @abc.abstractmethod
    def deviations(self, kept: Float[Array, "n n"]) -> Float[Array, " n"]:
        """Standard deviations (n,) of the covariance that `kept` (n, n) stands for."""

    @abc.abstractmethod
    def predict(self, kept: Float[Array, "n n"], F: Float[Array, "n n"], G: Float[Array, "n m"]) -> Float[Array, "n n"]:
        """`kept` (n, n) after a step of Jacobian F with process noise of covariance G Gᵀ."""

    @abc.abstractmethod
    def update(
        self, kept: Float[Array, "n n"], C: Float[Array, "c n"], R_root: Float[Array, "c c"], mask: Bool[Array, " c"]
    ) -> tuple[Float[Array, "n c"], Float[Array, "c c"], Float[Array, "n n"]]:
        """Gain, lower-triangular factor of the innovation's covariance, and `kept` (n, n) after a measurement.

        `C` (c, n) is its Jacobian, `R_root` (c, c) a root of its noise, and `mask` (c,) says which channels were
        measured.
        """

    @abc.abstractmethod
    def seen(self, kept: Float[Array, "n n"], C: Float[Array, "c n"]) -> Float[Array, "c c"]:
        """C P Cᵀ with P the covariance that `kept` (n, n) stands for."""

    @abc.abstractmethod
    def restart(self, root: Float[Array, "n n"], kept: Float[Array, "q q"]) -> Float[Array, "q q"]:
        """`kept` with its first n numbers forgotten: they start anew from `root`, the others keep their marginal."""


class SquareRoot(AbstractForm):
    """Keeps J with P = J Jᵀ; `propagation` says by which factorisation it is made square again after a step."""

    propagation: Literal["qr", "svd"] = eqx.field(static=True, default="qr")

    def start(self, root: Float[Array, "n n"]) -> Float[Array, "n n"]:
        """The root itself."""
        return root

    def covariance(self, kept: Float[Array, "n n"]) -> Float[Array, "n n"]:
        """J Jᵀ."""
        return times(kept, kept.T)

    def factor(self, kept: Float[Array, "n n"]) -> Float[Array, "n n"]:
        """J made triangular."""
        return by_qr(kept)

    def deviations(self, kept: Float[Array, "n n"]) -> Float[Array, " n"]:
        """Lengths of the rows of J."""
        return jnp.linalg.norm(kept, axis=1)

    def predict(self, kept: Float[Array, "n n"], F: Float[Array, "n n"], G: Float[Array, "n m"]) -> Float[Array, "n n"]:
        """[F J, G] made square."""
        factor = by_qr if self.propagation == "qr" else by_svd
        return factor(stacked(F, kept, G))

    def update(
        self, kept: Float[Array, "n n"], C: Float[Array, "c n"], R_root: Float[Array, "c c"], mask: Bool[Array, " c"]
    ) -> tuple[Float[Array, "n c"], Float[Array, "c c"], Float[Array, "n n"]]:
        """The paper's update."""
        return update(kept, C, R_root, mask)

    def seen(self, kept: Float[Array, "n n"], C: Float[Array, "c n"]) -> Float[Array, "c c"]:
        """C J squared."""
        CJ = times(C, kept)
        return times(CJ, CJ.T)

    def restart(self, root: Float[Array, "n n"], kept: Float[Array, "q q"]) -> Float[Array, "q q"]:
        """The root of the marginal is made of the rows of J."""
        return block_diag(root, by_qr(kept[root.shape[0] :]))


class Covariance(AbstractForm):
    """Keeps P: the textbook's form, for comparison. In low precision it loses positive definiteness."""

    def start(self, root: Float[Array, "n n"]) -> Float[Array, "n n"]:
        """The root squared."""
        return root @ root.T

    def covariance(self, kept: Float[Array, "n n"]) -> Float[Array, "n n"]:
        """P itself."""
        return kept

    def factor(self, kept: Float[Array, "n n"]) -> Float[Array, "n n"]:
        """Cholesky's factor."""
        return cholesky(kept)

    def deviations(self, kept: Float[Array, "n n"]) -> Float[Array, " n"]:
        """Roots of the diagonal of P."""
        return jnp.sqrt(jnp.diag(kept))

    def predict(self, kept: Float[Array, "n n"], F: Float[Array, "n n"], G: Float[Array, "n m"]) -> Float[Array, "n n"]:
        """F P Fᵀ + G Gᵀ."""
        return times(times(F, kept), F.T) + times(G, G.T)

    def update(
        self, kept: Float[Array, "n n"], C: Float[Array, "c n"], R_root: Float[Array, "c c"], mask: Bool[Array, " c"]
    ) -> tuple[Float[Array, "n c"], Float[Array, "c c"], Float[Array, "n n"]]:
        """P⁺ = (I - K C) P."""
        return covariance_update(kept, C, R_root, mask)

    def seen(self, kept: Float[Array, "n n"], C: Float[Array, "c n"]) -> Float[Array, "c c"]:
        """From P itself."""
        return times(times(C, kept), C.T)

    def restart(self, root: Float[Array, "n n"], kept: Float[Array, "q q"]) -> Float[Array, "q q"]:
        """The marginal is a block of P."""
        n = root.shape[0]
        return block_diag(root @ root.T, kept[n:, n:])
