r"""The log evidence of the recordings with some candidates in the model and under some disturbance.

With whitened residual r, columns J of the free parameters and S of chosen candidates, amplitudes a of a Gaussian prior
that is worth one sample ($\pi = 1/N$ in units of each column's length), what the data say is

$-\ln p = \sum\ln|L| + \tfrac12\ln|A| - \tfrac12\sum\ln\pi + \tfrac12(r^Tr - b^TA^{-1}b),\quad
A = [J\,S]^T[J\,S] + \text{priors},\; b = [J\,S]^Tr$

(Kass and Wasserman 1995, J. Am. Stat. Assoc. 90). A is a block of one matrix of products of all columns, so any set of
candidates costs a small Cholesky factor and no pass through the data. How large the disturbance is depends on what is
in the model: what was left out looks like a disturbance until it is put in. So evidence is the largest over several
disturbances, and a set that may win has its own estimated.

A free number that differs by run has a column more for each run, its own cut to that run, with amplitudes of the most
probable prior standard deviation s; s counts as one number, worth one sample like any. The cut columns need products
with all others by run alone.
"""

import dataclasses
from collections.abc import Sequence

import jax
import numpy as np
from jaxtyping import Float
from scipy.linalg import block_diag

from ...estimate import estimate_disturbance
from ...likelihood import Columns, Disturbance, System, by_share, padded_width, run_products, shares, with_constants
from .. import settings
from .columns import EffectColumns, columns_of
from .innovation_search import root_or_one
from .products import Products, conditional
from .view import View

# of the estimated disturbance: so small that it absorbs nothing of a simulation's error, and not singular
_STILL = 1e-6
# bytes that columns may take which are kept from one pass to the next
_MEMORY = 2**30


@dataclasses.dataclass(frozen=True)
class Evidence:
    """A view, the columns of all candidates, and their products.

    **Fields**

    - `columns`: of the q candidates. `length`: (q,) that of each under the first disturbance, of which `products` have
      them in units.
    - `varied`: (v,) the free numbers that may differ by run, among those of the view.
    - `shares`: the residual's, the free parameters' and the candidates' columns of shares of the runs, placed where
      programs take them from; none where they would take much memory.
    """

    view: View
    columns: EffectColumns
    length: np.ndarray
    products: list[Products]
    shares: tuple[Columns, ...]
    varied: tuple[int, ...] = ()

    @classmethod
    def of(
        cls,
        view: View,
        columns: EffectColumns,
        disturbances: Sequence[Disturbance] = (),
        varied: Sequence[int] = (),
    ) -> "Evidence":
        """Under the given disturbances, or shares of the view's."""
        first, *more = disturbances or with_smaller(view.disturbance)
        raw = cls(view, columns, np.ones(len(columns)), [], _kept(view, columns), tuple(varied))
        products = raw.under(first)
        made = dataclasses.replace(raw, length=root_or_one(np.diag(products.gram)[len(view.prior) :]))
        made.products.append(products.scaled(made._unit))
        made.products.extend(made.under(disturbance) for disturbance in more)
        return made

    @property
    def _unit(self) -> Float[np.ndarray, " n"]:
        """What each column is divided by, the residual's and the free parameters' included."""
        return np.concatenate([np.ones(len(self.view.prior)), self.length])

    @property
    def given(self) -> list[Products]:
        """The products under the view's disturbance and shares of it, before any other was estimated."""
        return self.products[: 1 + len(settings.DISTURBANCE_SHARES)]

    @property
    def lengths(self) -> Float[np.ndarray, " n"]:
        """(q + v,) in which the amplitudes of all candidate columns are, deviations by run included."""
        return np.append(self.length, self.view.length[list(self.varied)])

    def under(self, disturbance: Disturbance) -> Products:
        """The products under a disturbance."""
        system, prior, unit = self.view.followed.system, self.view.prior, self._unit

        at = [1 + number for number in self.varied]
        few = padded_width(len(prior)) if at else 0
        kept = dict(zip((some.start for some in shares(*system.measured.shape[:2])), self.shares, strict=False))

        def own(runs: slice) -> tuple[Disturbance, System, Columns, int, list[int], int]:
            columns = kept[runs.start] if kept else self.columns.placed(runs)
            return disturbance, system.share(runs), columns, few, at, len(unit)

        found = by_share(_cut_run_products, own, *system.measured.shape[:2])
        grams, by_run, log_determinants = zip(*found, strict=True)
        gram = sum(grams) / np.outer(unit, unit)
        gram[: len(prior), : len(prior)] += prior
        # the last share may have empty runs
        cut = np.concatenate(by_run)[: len(system.measured)] / unit
        samples = int(np.sum(np.asarray(system.measured)))
        return Products(disturbance, gram, sum(log_determinants), samples, len(prior), cut, cut[:, :, at])

    def simulated(self) -> Products:
        """The products under a disturbance that absorbs nothing: those of a simulation's error."""
        own = self.view.disturbance
        return self.under(Disturbance(_STILL * own.force, own.time, np.ones_like(own.noise)))

    def predicted(self, chosen: Sequence[int], products: Products) -> Float[np.ndarray, " m"]:
        """Log probability of each part of the recordings by the others, which leave every number some room.

        At the estimates by the others, parameters that these hardly identify would count as wrong predictions.
        """
        inside, fixed = products.within(chosen)
        own = self.within(chosen, products)
        unit = np.concatenate([np.ones(len(own.view.prior)), own.length[list(fixed)]])
        parts = own.view.products(own.columns.picked(fixed).placed, products.disturbance).of(unit)
        return conditional(inside.with_priors(fixed), parts)

    def within(self, chosen: Sequence[int], products: Products) -> "Evidence":
        """The same columns for the view in whose system the deviations by run among `chosen` are states."""
        spreads = products.spreads(chosen)
        if not spreads:
            return self
        at = [1 + self.varied[number] for number in spreads]
        followed, base = self.view.followed, self.view.base
        own = jax.tree.map(lambda column: column[..., at], base)
        system = with_constants(followed.system, own, np.array([*spreads.values()]))
        forcing = np.pad(np.asarray(base.forcing), [(0, 0), (0, 0), (0, len(at)), (0, 0)])
        followed = dataclasses.replace(followed, system=system)
        view = dataclasses.replace(self.view, followed=followed, base=dataclasses.replace(base, forcing=forcing))
        return dataclasses.replace(self, view=view, columns=dataclasses.replace(self.columns, view=view), shares=())

    def seen_from(self, view: View, keep: np.ndarray) -> "Evidence":
        """Of a view along the same path whose residual and free parameters are sums `keep` (1 + p, 1 + m) of these."""
        columns = dataclasses.replace(self.columns, view=view)
        names = lambda one: [row.name for row in one.vehicle.layout.free]
        varied = tuple(names(view).index(names(self.view)[number]) for number in self.varied)
        products = [p.seen_from(keep) for p in self.products]
        return Evidence(view, columns, self.length, products, _kept(view, columns), varied)

    def estimate(self, chosen: Sequence[int], start: Disturbance) -> Products:
        """The products under the disturbance that is left with the candidate columns `chosen` in the model."""
        own = self.within(chosen, self.best(chosen)[1])
        fixed = [c for c in chosen if c < len(self.columns)]
        picked = own.picked(fixed).padded(most_columns())
        worth = np.where(np.arange(most_columns()) < len(fixed), 1.0 / self.products[0].samples, 1.0)
        prior = np.asarray(block_diag(self.view.prior, np.diag(worth)))
        system, columns = own.view.followed.system, own.view.base + picked
        found = estimate_disturbance(system, columns, prior, start)
        return self.under(jax.tree.map(np.asarray, found))

    def left(self, chosen: Sequence[int], products: Products) -> Columns:
        """The residual, less what free parameters and `chosen` take up of it according to `products`.

        Deviations by run are left in it, for the system of `within`.
        """
        weights, known = products.weights(chosen), len(self.view.prior)
        own, fixed = self.within(chosen, products), products.within(chosen)[1]
        weights = np.concatenate([weights[:known], weights[[known + i for i in fixed]]])
        beside = own.view.base + own.picked(fixed)
        return jax.tree.map(lambda column: (column @ weights)[..., None], beside)

    def picked(self, chosen: Sequence[int]) -> Columns:
        """Some of the candidates' columns, of unit length."""
        return jax.tree.map(lambda column: column / self.length[list(chosen)], self.columns.picked(chosen).dense())

    def best(self, chosen: Sequence[int]) -> tuple[float, Products]:
        """The largest log evidence of `chosen` over the disturbances, and the products where it is."""
        values = [products.log_evidence(chosen) for products in self.products]
        best = int(np.argmax(values))
        return values[best], self.products[best]


def with_smaller(one: Disturbance) -> list[Disturbance]:
    """A disturbance and shares of it, which absorb less of what is missing."""
    return [one, *(dataclasses.replace(one, force=share * one.force) for share in settings.DISTURBANCE_SHARES)]


def most_columns() -> int:
    """The columns of effects that one selection takes, for which the disturbance's program has room."""
    return 2 * settings.MOST_EFFECTS


def _cut_run_products(
    disturbance: Disturbance, system: System, columns: Columns, few: int, at: list[int], count: int
) -> tuple[np.ndarray, np.ndarray, float]:
    """The products of the first `count` columns, and by run of those `at` which numbers that differ by run are."""
    found, own, log_determinant = run_products(disturbance, system, columns, few)
    return np.asarray(found)[:count, :count], np.asarray(own)[:, at, :count], float(log_determinant)


def _kept(view: View, columns: EffectColumns) -> tuple[Columns, ...]:
    """The shares' columns; none where they would take much memory, and are made each time."""
    system = view.followed.system
    rows = sum(M.shape[0] * M.shape[1] * M.shape[2] for M in (system.C, system.A))
    width = padded_width(len(view.prior) + len(columns))
    every = shares(*system.measured.shape[:2])
    return tuple(columns.placed(runs) for runs in every) if 8 * rows * width < _MEMORY else ()


def evidence_of(view: View) -> float:
    """Log evidence of a view's own model, each free number's prior, and each spread between runs, worth one sample."""
    products = Evidence.of(view, columns_of(view, []), [view.disturbance]).products[0]
    count = products.known - 1 + len(view.vehicle.spreads)
    return float(products.log_evidence([]) - 0.5 * count * np.log(products.samples))
