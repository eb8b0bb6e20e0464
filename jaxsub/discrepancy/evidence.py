r"""The log evidence of the recordings with some candidates in the model and under some disturbance.

With whitened residual r, columns J of the free parameters and S of chosen candidates, amplitudes a of a Gaussian prior
that is worth one sample ($\pi = 1/N$ in units of each column's length), what the data say is

$-\ln p = \sum\ln|L| + \tfrac12\ln|A| - \tfrac12\sum\ln\pi + \tfrac12(r^Tr - b^TA^{-1}b),\quad
A = [J\,S]^T[J\,S] + \text{priors},\; b = [J\,S]^Tr$

(Kass and Wasserman 1995, J. Am. Stat. Assoc. 90). A is a block of one matrix of products of all columns, so any set of
candidates costs a small Cholesky factor and no pass through the data. How large the disturbance is depends on what is
in the model: what was left out looks like a disturbance until it is put in. So evidence is the largest over several
disturbances, and a set that may win has its own estimated.
"""

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Float
from scipy.linalg import block_diag

from ..arrays import aligned_zeros
from ..estimate import estimate_disturbance
from ..likelihood import Columns, Disturbance, System, padded_width, total_products
from ..programs import on_cores
from .columns import EffectColumns, columns_of
from .innovation_search import root_or_one
from .settings import DISTURBANCE_SHARES, MOST_COLUMNS
from .view import Parts, View

# products that evidence begins with
FIRST = len(DISTURBANCE_SHARES)
# samples of a share of the runs, and bytes that columns may take which are kept from one pass to the next
_SAMPLES, _MEMORY = 4096, 2**30


class Gains(NamedTuple):
    """What each of some candidates would add: log evidence, χ² under "nothing left out", and its amplitudes."""

    evidence: np.ndarray
    statistic: np.ndarray
    amplitudes: list[np.ndarray]


def integrated(gram: Float[np.ndarray, "q q"]) -> float:
    r"""$\ln\int e^{-\frac12 |r + Ja|^2}da$, but for $2\pi$, by the products of [r, J], priors of a included."""
    squares = gram[0, 0] - gram[1:, 0] @ np.linalg.solve(gram[1:, 1:], gram[1:, 0])
    return -0.5 * float(squares + np.linalg.slogdet(gram[1:, 1:])[1])


def conditional(gram: Float[np.ndarray, "q q"], parts: Parts) -> Float[np.ndarray, " m"]:
    r"""Log density of each part of the recordings given the others, $\ln Z(H) - \ln Z(H - H_b) - \ln|L_b|$.

    `gram` is H, the products of [r, J], priors included; `parts` have the $H_b$ without them and the $\ln|L_b|$.
    """
    whole = integrated(gram)
    return np.array([whole - integrated(gram - part) for part in parts.products]) - parts.log_determinants


@dataclasses.dataclass(frozen=True)
class Products:
    """Products of all columns under one disturbance.

    **Fields**

    - `gram`: (1 + p + q, 1 + p + q): residual, free parameters, candidates; priors of the first 1 + p included.
    - `log_determinant`: half that of the residuals' covariance. `samples`: how many. `known`: 1 + p.
    """

    disturbance: Disturbance
    gram: np.ndarray
    log_determinant: float
    samples: int
    known: int

    def log_evidence(self, chosen: Sequence[int]) -> float:
        """Of the recordings with the candidate columns `chosen` in the model."""
        priors = 0.5 * len(chosen) * np.log(self.samples)
        return float(integrated(self.with_priors(chosen)) - self.log_determinant - priors)

    def gains(self, chosen: Sequence[int], owners: Sequence[Sequence[int]]) -> Gains:
        """What each further candidate would add to `chosen`."""
        left = self._left(chosen)
        evidence, statistic = np.zeros(len(owners)), np.zeros(len(owners))
        sizes = [np.zeros(0)] * len(owners)
        # all candidates with as many columns at once
        for count in {len(own) for own in owners}:
            alike = [i for i, own in enumerate(owners) if len(own) == count]
            at = 1 + np.array([list(owners[i]) for i in alike], int).reshape(-1, count)
            block = left[at[:, :, None], at[:, None, :]] + np.eye(count) / self.samples
            across = left[at, 0]
            amplitude = np.linalg.solve(block, across[..., None])[..., 0]
            statistic[alike] = np.sum(across * amplitude, axis=1)
            evidence[alike] = 0.5 * (statistic[alike] - np.linalg.slogdet(block * self.samples)[1])
            for i, size in zip(alike, amplitude, strict=True):
                sizes[i] = size
        return Gains(evidence, statistic, sizes)

    def remaining(self, chosen: Sequence[int], more: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
        """Products of the candidate columns `more` and theirs with the residual, less what `chosen` take up."""
        left = self._left(chosen, more)
        return left[1:, 1:], left[1:, 0]

    def sums(self, chosen: Sequence[int], more: Sequence[int], weights: np.ndarray) -> np.ndarray:
        """The sums of columns that keep `chosen` and have for other candidates sums of `more`, by `weights` (_, m)."""
        kept = [0, *self._index(chosen)]
        whole = np.zeros((len(self.gram), len(kept) + weights.shape[1]))
        whole[kept, range(len(kept))] = 1.0
        whole[[self.known + c for c in more], len(kept) :] = weights
        return whole

    def mixed(self, sums: np.ndarray, known: int) -> "Products":
        """Of sums of the columns, the first `known` of which are of the residual and the free parameters."""
        return dataclasses.replace(self, gram=sums.T @ self.gram @ sums, known=known)

    def seen_from(self, keep: np.ndarray) -> "Products":
        """With sums `keep` (1 + p, 1 + m) of the residual and the free parameters in the place of these."""
        candidates = len(self.gram) - self.known
        return self.mixed(np.asarray(block_diag(keep, np.eye(candidates))), keep.shape[1])

    def scaled(self, length: np.ndarray) -> "Products":
        """With every column divided by its `length`."""
        return dataclasses.replace(self, gram=self.gram / np.outer(length, length))

    def weights(self, chosen: Sequence[int]) -> np.ndarray:
        """(1 + p + q,) of the columns whose sum is the residual less what parameters and `chosen` take up of it."""
        index, found = self._index(chosen), np.zeros(len(self.gram))
        found[0], found[index] = 1.0, -np.linalg.solve(self.with_priors(chosen)[1:, 1:], self.gram[index, 0])
        return found

    def fall(self, chosen: Sequence[int]) -> float:
        """By how much χ² falls with the candidate columns `chosen`."""
        squares = lambda at: float(self.gram[at, 0] @ np.linalg.lstsq(self.gram[np.ix_(at, at)], self.gram[at, 0])[0])
        return squares(self._index(chosen)) - squares(self._index([]))

    def explained(self, chosen: Sequence[int], owners: Sequence[Sequence[int]]) -> np.ndarray:
        """The share of what `chosen` leave of χ² that each further candidate explains."""
        return self.gains(chosen, owners).statistic / max(float(self._left(chosen)[0, 0]), 1e-300)

    def unabsorbed(self) -> np.ndarray:
        """(q,) squares of each candidate column that the free parameters cannot absorb."""
        return np.diag(self._left([]))[1:]

    def kept(self, owners: Sequence[Sequence[int]]) -> np.ndarray:
        """The share of each candidate's squares that the free parameters cannot absorb, the least over its columns."""
        own = np.diag(self.gram)[self.known :]
        share = np.where(own > 0.0, self.unabsorbed() / np.maximum(own, 1e-300), 0.0)
        return np.array([float(np.min(share[list(columns)])) for columns in owners])

    def _index(self, chosen: Sequence[int]) -> list[int]:
        """Where the free parameters and the candidate columns `chosen` are."""
        return [*range(1, self.known), *(self.known + c for c in chosen)]

    def with_priors(self, chosen: Sequence[int]) -> Float[np.ndarray, "q q"]:
        """Products of the residual, the free parameters and the `chosen` columns, with the priors of the latter."""
        index = [0, *self._index(chosen)]
        worth = np.repeat([0.0, 1.0 / self.samples], [self.known, len(chosen)])
        return self.gram[np.ix_(index, index)] + np.diag(worth)

    def _left(self, chosen: Sequence[int], more: Sequence[int] | None = None) -> np.ndarray:
        """(1 + q, 1 + q) products of the residual and candidates, less what `chosen` and parameters take up.

        Of the candidate columns `more`, or of all.
        """
        rest = [0, *(self.known + c for c in (range(len(self.gram) - self.known) if more is None else more))]
        mixed = self.gram[np.ix_(self._index(chosen), rest)]
        return self.gram[np.ix_(rest, rest)] - mixed.T @ np.linalg.solve(self.with_priors(chosen)[1:, 1:], mixed)


@dataclasses.dataclass(frozen=True)
class Evidence:
    """A view, the columns of all candidates, and their products.

    **Fields**

    - `columns`: of the q candidates. `length`: (q,) that of each under the view's disturbance, of which `products` have
      them in units.
    - `shares`: the residual's, the free parameters' and the candidates' columns of shares of the runs, placed where
      programs take them from; none where they would take much memory.
    """

    view: View
    columns: EffectColumns
    length: np.ndarray
    products: list[Products]
    shares: tuple[Columns, ...]

    @classmethod
    def of(cls, view: View, columns: EffectColumns, disturbances: Sequence[Disturbance] = ()) -> "Evidence":
        """Under the given disturbances, or shares of the view's."""
        own, known = view.disturbance, len(view.prior)
        raw = cls(view, columns, np.ones(len(columns)), [], _kept(view, columns))
        first = raw.under(own)
        length = root_or_one(np.diag(first.gram)[known:])
        made = dataclasses.replace(raw, length=length)
        shares = [own, *(dataclasses.replace(own, force=share * own.force) for share in DISTURBANCE_SHARES[1:])]
        for disturbance in disturbances or shares:
            made.products.append(first.scaled(made._unit) if disturbance is own else made.under(disturbance))
        return made

    @property
    def _unit(self) -> Float[np.ndarray, " n"]:
        """What each column is divided by, the residual's and the free parameters' included."""
        return np.concatenate([np.ones(len(self.view.prior)), self.length])

    def under(self, disturbance: Disturbance) -> Products:
        """The products under a disturbance."""
        system, prior, unit = self.view.followed.system, self.view.prior, self._unit

        def of(number: int, runs: slice) -> tuple[np.ndarray, float]:
            columns = self.shares[number] if self.shares else _placed(self.view, self.columns, runs)
            found, log_determinant = total_products(disturbance, system.share(runs), columns)
            return np.asarray(found)[: len(unit), : len(unit)], float(log_determinant)

        grams, log_determinants = zip(*on_cores(of, [*enumerate(_shares(system))]), strict=True)
        gram = sum(grams) / np.outer(unit, unit)
        gram[: len(prior), : len(prior)] += prior
        samples = int(np.sum(np.asarray(system.measured)))
        return Products(disturbance, gram, sum(log_determinants), samples, len(prior))

    def predicted(self, chosen: Sequence[int], products: Products) -> Float[np.ndarray, " m"]:
        """Log probability of each part of the recordings by the others, which leave every number some room.

        At the estimates by the others, parameters that these hardly identify would count as wrong predictions.
        """
        parts = self.view.products(self.view.base + self.picked(chosen), products.disturbance)
        return conditional(products.with_priors(chosen), parts)

    def seen_from(self, view: View, keep: np.ndarray) -> "Evidence":
        """Of a view along the same path whose residual and free parameters are sums `keep` (1 + p, 1 + m) of these."""
        columns = dataclasses.replace(self.columns, view=view)
        return Evidence(view, columns, self.length, [p.seen_from(keep) for p in self.products], _kept(view, columns))

    def estimate(self, chosen: Sequence[int], start: Disturbance) -> Products:
        """The products under the disturbance that is left with the candidate columns `chosen` in the model."""
        picked = self.picked([*chosen, *[0] * (MOST_COLUMNS - len(chosen))])
        filled = np.arange(MOST_COLUMNS) < len(chosen)
        picked = jax.tree.map(lambda column: np.where(filled, column, 0.0), picked)
        worth = np.where(filled, 1.0 / self.products[0].samples, 1.0)
        prior = np.asarray(block_diag(self.view.prior, np.diag(worth)))
        system, columns = self.view.followed.system, self.view.base + picked
        found = estimate_disturbance(system, columns, prior, start)
        return self.under(jax.tree.map(np.asarray, found))

    def left(self, chosen: Sequence[int], products: Products) -> Columns:
        """The residual, less what free parameters and `chosen` take up of it according to `products`."""
        weights, known = products.weights(chosen), len(self.view.prior)
        weights = np.concatenate([weights[:known], weights[[known + i for i in chosen]]])
        beside = self.view.base + self.picked(chosen)
        return jax.tree.map(lambda column: (column @ weights)[..., None], beside)

    def picked(self, chosen: Sequence[int]) -> Columns:
        """Some of the candidates' columns, of unit length."""
        return jax.tree.map(lambda column: column / self.length[list(chosen)], self.columns.picked(chosen).dense())

    def best(self, chosen: Sequence[int]) -> tuple[float, Products]:
        """The largest log evidence of `chosen` over the disturbances, and the products where it is."""
        values = [products.log_evidence(chosen) for products in self.products]
        best = int(np.argmax(values))
        return values[best], self.products[best]


def _shares(system: System) -> list[slice]:
    """Shares of the runs, alike in size, that are filtered one after the other or side by side on cores."""
    runs, samples = system.measured.shape[:2]
    count = -(-runs // max(1, _SAMPLES // samples))
    size = -(-runs // count)
    return [slice(first, first + size) for first in range(0, runs, size)]


def _kept(view: View, columns: EffectColumns) -> tuple[Columns, ...]:
    """The shares' columns; none where they would take much memory, and are made each time."""
    system = view.followed.system
    rows = sum(M.shape[0] * M.shape[1] * M.shape[2] for M in (system.C, system.A))
    width = padded_width(len(view.prior) + len(columns))
    return tuple(_placed(view, columns, runs) for runs in _shares(system)) if 8 * rows * width < _MEMORY else ()


def _placed(view: View, candidates: EffectColumns, runs: slice) -> Columns:
    """A view's own columns and those of candidates in a share of the runs, padded to the width of a program.

    They are placed where programs take them from, copied once. A share with fewer runs than the others has empty ones.
    """
    known, size = len(view.prior), runs.stop - runs.start

    def beside(own: np.ndarray) -> np.ndarray:
        whole = aligned_zeros((size, *own.shape[1:3], padded_width(known + len(candidates))))
        whole[: len(own[runs]), ..., :known] = own[runs]
        return whole

    made = jax.tree.map(beside, view.base)
    there = len(view.base.shown[runs])
    candidates.write(jax.tree.map(lambda M: M[:there, ..., known : known + len(candidates)], made), runs)
    return jax.tree.map(jax.device_put, made)


def evidence_of(view: View) -> float:
    """Log evidence of a view's own model, each free number's prior worth one sample."""
    products = Evidence.of(view, columns_of(view, []), [view.disturbance]).products[0]
    return float(products.log_evidence([]) - 0.5 * (products.known - 1) * np.log(products.samples))
