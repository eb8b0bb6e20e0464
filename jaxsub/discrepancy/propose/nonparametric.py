"""The nonparametric force that explains most: a smooth function of one variable in one equation.

All variables and equations are screened by how well they predict the estimated disturbance in cross-validation. The
evidence of the best variable of each equation is then computed, and of the next few of the equation where it is most.
"""

import dataclasses
import itertools
from collections.abc import Callable, Sequence

import numpy as np
from scipy import special

from ...effects import KNOTS, SmoothForce, with_numbers
from ...likelihood import Disturbance, smoothed
from .. import settings
from ..linearise.columns import columns_of
from ..linearise.evidence import Evidence, with_smaller
from ..linearise.products import Products, conditional
from ..linearise.view import Parts, View
from .smoothness import FINE, Smooth, coarse, smoothest
from .spline_basis import basis_forces, promising_forces, smooth_forces

# least information of a knot, of that of all knots
_ROUNDING = 1e-9


@dataclasses.dataclass(frozen=True)
class Pattern:
    """The nonparametric force of largest evidence on top of the selected effects.

    **Fields**

    - `force`: with its predicted parameters; `heights`: (FINE,) of it, N or N m, at finer knots. `near`: the share of
      their squares, along the motion, that the force keeps.
    - `p_value`: corrected for all forces screened; `significant`: whether that is small, and the force improves the
      prediction of parts of the recordings by the others.
    - `alone`: log evidence with it and nothing else, its prior probability included.
    - `explained`: the share of what the selected effects and it explain together that the effects explain alone.
    """

    force: SmoothForce
    heights: np.ndarray
    near: float
    p_value: float
    significant: bool
    alone: float
    explained: float

    @property
    def joins(self) -> bool:
        """Whether moreover its few knots are near enough to the fine ones for a model."""
        return self.significant and self.near > settings.MAJORITY

    @property
    def described(self) -> str:
        """The sum of at most two elementary terms that is nearest to it, by an information criterion."""
        x, y, name = np.linspace(self.force.low, self.force.high, FINE), self.heights, self.force.variable
        terms = {"1": np.ones(FINE), name: x, f"{name}²": x**2, f"{name} |{name}|": x * np.abs(x), f"{name}³": x**3}
        turns = [_wave(2.0 * np.pi * periods / (x[-1] - x[0]), x, y) for periods in np.arange(1.0, FINE / 4, 0.25)]
        kappa, phase, wave = min(turns, key=lambda turn: _fitted(turn[2][:, None], y)[1])
        terms[f"sin({kappa:.3g} {name} {phase:+.2g})"] = wave
        chosen = [*itertools.combinations(terms, 1), *itertools.combinations(terms, 2)]
        fits = [(pick, *_fitted(np.stack([terms[t] for t in pick], axis=1), y)) for pick in chosen]
        # a wave brings its place on two axes with it
        count = lambda pick: len(pick) + 2 * sum(term.startswith("sin") for term in pick)
        pick, weights, left = min(fits, key=lambda fit: KNOTS * np.log(fit[2] + 1e-12) + count(fit[0]) * np.log(KNOTS))
        formula = " + ".join(f"{w:.3g} {t}" for w, t in zip(weights, pick, strict=True))
        return f"about {formula}, which leaves {np.sqrt(left):.0%} of it"


def _wave(kappa: float, x: np.ndarray, y: np.ndarray) -> tuple[float, float, np.ndarray]:
    """The wave number, the phase that follows `y` best, and the wave."""
    (along, across), _ = _fitted(np.stack([np.sin(kappa * x), np.cos(kappa * x)], axis=1), y - y.mean())
    phase = float(np.arctan2(across, along))
    return float(kappa), phase, np.sin(kappa * x + phase)


def _fitted(columns: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, float]:
    """Weights of least squares, and the share of the squares that they leave."""
    weights = np.linalg.lstsq(columns, y)[0]
    return weights, float(np.sum((y - columns @ weights) ** 2) / max(np.sum(y**2), 1e-300))


def pattern(view: View, chosen: Evidence, columns: list[int], under: Sequence[Products]) -> Pattern | None:
    """The force of largest evidence beyond the `columns` of the `chosen` effects; None where nothing moves.

    Under shares of the disturbances of the products `under`, of which the last is that with the chosen effects.
    """
    forces = smooth_forces(view)
    if not forces:
        return None
    left = chosen.left(columns, under[-1])
    system = chosen.within(columns, under[-1]).view.followed.system
    mean = smoothed(under[-1].disturbance, system, left).force
    picked = chosen.columns.picked([c for c in columns if c < len(chosen.columns)])
    varying = [c - len(chosen.columns) for c in columns if c >= len(chosen.columns)]
    beside = lambda force: picked + columns_of(view, basis_forces(view, force, FINE))

    disturbances = lambda products: with_smaller(products.disturbance)

    def weighed(force: SmoothForce) -> _Weighed:
        found = Evidence.of(view, beside(force), disturbances(under[-1]), chosen.varied)
        return _Weighed(force, found, len(picked), varying)

    # one force after the other: products between forces are not needed
    found = _strongest(promising_forces(view, forces, np.asarray(mean)), weighed)
    found.products.extend(found.evidence.under(one) for products in under[:-1] for one in disturbances(products))
    values = found.values(found.held)
    at = int(np.argmax(values))
    gain = float(np.max(values)) - found.before
    p_value = min(1.0, 0.5 * len(forces) * len(settings.LENGTH_SCALES) * float(special.chdtrc(1, 2.0 * max(0.0, gain))))
    # the prior standard deviation counts as one parameter, and every force is equally probable a priori
    alone = float(np.max(found.values([]))) - 0.5 * float(np.log(found.samples)) - float(np.log(len(forces)))
    heights, size, explained = found.heights(at)
    significant = p_value < settings.SIGNIFICANCE and found.predicts()
    force = dataclasses.replace(found.force, spread=float(f"{size:.6g}"))
    force, near = found.nearest(at, force, heights)
    return Pattern(force, heights, near, p_value, significant, alone, explained)


@dataclasses.dataclass(frozen=True)
class _Weighed:
    """The evidence of the chosen columns, the first `count`, and of the hat functions of one `force`.

    **Fields**: `varying`: the chosen numbers that differ by run.
    """

    force: SmoothForce
    evidence: Evidence
    count: int
    varying: Sequence[int]

    @property
    def products(self) -> list[Products]:
        """Under each disturbance, in units of the columns' lengths."""
        return self.evidence.products

    @property
    def length(self) -> np.ndarray:
        """(FINE,) of the hat functions."""
        return self.evidence.length[self.count :]

    @property
    def held(self) -> list[int]:
        """The chosen columns."""
        return [*range(self.count), *(self.count + FINE + k for k in self.varying)]

    @property
    def own(self) -> list[int]:
        """The columns of the hat functions."""
        return list(range(self.count, self.count + FINE))

    @property
    def samples(self) -> int:
        """How many."""
        return self.products[0].samples

    @property
    def before(self) -> float:
        """Log evidence of the chosen columns."""
        return max(products.log_evidence(self.held) for products in self.products)

    def values(self, held: list[int]) -> np.ndarray:
        """Log evidence with the force more than the columns `held`, under each disturbance."""
        gain = lambda p: smoothest(p, held, self.own, self.length).gain
        return np.array([p.log_evidence(held) + gain(p) for p in self.products])

    @property
    def value(self) -> float:
        """The largest log evidence with the force."""
        return float(np.max(self.values(self.held)))

    def together(self, products: Products) -> tuple[Products, np.ndarray, Smooth]:
        """Products of the chosen columns and of those of the force's prior, the sums they are of, and the function."""
        smooth = smoothest(products, self.held, self.own, self.length)
        inside, fixed = products.within(self.held)
        sums = inside.sums(fixed, self.own, smooth.weights)
        return inside.mixed(sums, products.known), sums, smooth

    def predicts(self) -> bool:
        """Whether the force improves the prediction of parts of the recordings, under the best disturbance of each."""
        found = []
        for products in self.products:
            own = self.evidence.within(self.held, products)
            unit = np.concatenate([np.ones(len(own.view.prior)), own.length])
            parts = own.view.products(own.columns.placed, products.disturbance).of(unit)
            found.append(self._predicted(products, parts))
        with_it, without = zip(*found, strict=True)
        return max(with_it) > max(without)

    def _predicted(self, products: Products, parts: Parts) -> tuple[float, float]:
        """Log probability of the parts of the recordings by each other, with and without the force."""
        both, sums, _ = self.together(products)
        mixed = parts._replace(products=sums.T @ parts.products @ sums)
        few = products.known + self.count
        fewer = parts._replace(products=parts.products[:, :few, :few])
        inside, fixed = products.within(self.held)
        with_it = conditional(both.with_priors([*fixed, *self.own]), mixed)
        return float(np.sum(with_it)), float(np.sum(conditional(inside.with_priors(fixed), fewer)))

    def heights(self, at: int) -> tuple[np.ndarray, float, float]:
        """The force at the knots, its prior standard deviation, and the share explained by the chosen columns."""
        both, _, smooth = self.together(self.products[at])
        gains = both.gains(range(self.count), [self.own])
        fall = self.products[at].fall(self.held)
        explained = fall / max(fall + float(gains.statistic[0]), 1e-300)
        heights = smooth.weights @ gains.amplitudes[0] / self.length
        return heights, smooth.size, float(np.clip(explained, 0.0, 1.0))

    def nearest(self, at: int, force: SmoothForce, heights: np.ndarray) -> tuple[SmoothForce, float]:
        """The force with the parameters nearest to `heights` along the motion, and the share of squares it keeps."""
        G, _ = self.products[at].remaining(self.held, self.own)
        G = G * np.outer(self.length, self.length)
        C, squares = coarse(), float(heights @ G @ heights)
        # knots without data are interpolated
        G = G + _ROUNDING * float(np.trace(G)) * np.eye(FINE)
        few = np.linalg.solve(C.T @ G @ C, C.T @ G @ heights)
        lost = float((heights - C @ few) @ G @ (heights - C @ few))
        numbers = {f"a_{j}": float(a) for j, a in enumerate(few)}
        return with_numbers(force, numbers), 1.0 - lost / max(squares, 1e-300)


def _strongest(ranked: Sequence[Sequence[SmoothForce]], weighed: Callable[[SmoothForce], _Weighed]) -> _Weighed:
    """The force of most evidence in the equation whose first force has the most."""
    value = lambda one: one.value
    best = max((weighed(own[0]) for own in ranked), key=value)
    more = next(own[1:] for own in ranked if own[0] is best.force)
    return max(itertools.chain([best], map(weighed, more)), key=value)


def most_explained(view: View, disturbance: Disturbance) -> float:
    """The largest share of the errors under a `disturbance` that one smooth force alone explains."""
    forces = smooth_forces(view)
    if not forces:
        return 0.0
    drawn = columns_of(view, (column for force in forces for column in basis_forces(view, force, KNOTS)))
    products = Evidence.of(view, drawn, [disturbance]).products[0]
    owners = [list(range(KNOTS * i, KNOTS * (i + 1))) for i in range(len(forces))]
    return float(np.max(products.explained([], owners)))
