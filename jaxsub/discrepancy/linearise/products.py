"""Products of the whitened residual, free parameters and candidates, and Gaussian integrals over their amplitudes."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.linalg import block_diag

from ...arrays import quietly
from ...likelihood import Disturbance
from .run_effect import RunEffect
from .view import Parts


class Gains(NamedTuple):
    """What each of some candidates would add: log evidence, χ² under "nothing left out", and its amplitudes."""

    evidence: np.ndarray
    statistic: np.ndarray
    amplitudes: list[np.ndarray]


@quietly
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
    - `by_run`: (R, v, 1 + p + q) products of v free numbers' columns, cut to each run, with all; `among`: (R, v, v)
      theirs with each other. Candidate column q + k is the deviations by run of the k-th of these numbers, of which
      the amplitude is their standard deviation.
    """

    disturbance: Disturbance
    gram: np.ndarray
    log_determinant: float
    samples: int
    known: int
    by_run: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros((0, 0, 0)))
    among: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros((0, 0, 0)))

    @property
    def count(self) -> int:
        """How many candidate columns there are, without deviations by run."""
        return len(self.gram) - self.known

    @property
    def _rows(self) -> np.ndarray:
        """`by_run`, as wide as the columns also where it has no number."""
        return self.by_run.reshape(*self.among.shape[:2], len(self.gram))

    def spreads(self, chosen: Sequence[int]) -> dict[int, float]:
        """The most probable standard deviation between runs of each number of which `chosen` has the deviations."""
        numbers, fixed = [c - self.count for c in chosen if c >= self.count], self._fixed(chosen)
        found: dict[int, float] = {}
        for number in numbers * min(len(numbers), 2):
            others = self._with_spreads({k: spread for k, spread in found.items() if k != number})
            found[number] = others._run_effect(fixed, number).spread
        return found

    def within(self, chosen: Sequence[int]) -> tuple["Products", list[int]]:
        """These with the deviations by run among `chosen` integrated out, and the other columns of `chosen`."""
        return self._with_spreads(self.spreads(chosen)), self._fixed(chosen)

    def _fixed(self, chosen: Sequence[int]) -> list[int]:
        return [c for c in chosen if c < self.count]

    def _with_spreads(self, spreads: Mapping[int, float]) -> "Products":
        made = self
        for number, spread in spreads.items():
            h, own = made.by_run[:, number], made.among[:, :, number]
            weight = spread**2 / (1.0 + spread**2 * own[:, number])
            made = dataclasses.replace(
                made,
                gram=made.gram - (h * weight[:, None]).T @ h,
                log_determinant=made.log_determinant + 0.5 * float(np.sum(np.log1p(spread**2 * own[:, number]))),
                by_run=made.by_run - (weight[:, None] * own)[..., None] * h[:, None],
                among=made.among - weight[:, None, None] * own[..., None] * own[:, None],
            )
        return made

    def _run_effect(self, chosen: Sequence[int], number: int) -> RunEffect:
        """The deviations by run of a number on top of the candidate columns `chosen`."""
        return RunEffect.of(self.left_by_run(chosen, number), self._left_with_residual(chosen, number))

    def left_by_run(self, chosen: Sequence[int], number: int) -> Float[np.ndarray, "r r"]:
        """Products of a number's column cut to each run, less what parameters and the columns `chosen` take up."""
        across = self.by_run[:, number][:, self._index(chosen)]
        taken = across @ np.linalg.solve(self.with_priors(chosen)[1:, 1:], across.T)
        return np.diag(self.among[:, number, number]) - taken

    def _left_with_residual(self, chosen: Sequence[int], number: int) -> Float[np.ndarray, " r"]:
        h, index = self.by_run[:, number], self._index(chosen)
        return h[:, 0] - h[:, index] @ np.linalg.solve(self.with_priors(chosen)[1:, 1:], self.gram[index, 0])

    def log_evidence(self, chosen: Sequence[int]) -> float:
        """Of the recordings with the candidate columns `chosen` in the model."""
        priors = 0.5 * len(chosen) * np.log(self.samples)
        inside, fixed = self.within(chosen)
        return float(integrated(inside.with_priors(fixed)) - inside.log_determinant - priors)

    def gains(self, chosen: Sequence[int], owners: Sequence[Sequence[int]]) -> Gains:
        """What each further candidate would add to `chosen`."""
        inside, fixed = self.within(chosen)
        left = inside._left(fixed)
        evidence, statistic = np.zeros(len(owners)), np.zeros(len(owners))
        sizes = [np.zeros(0)] * len(owners)
        varying = {i: own[0] - self.count for i, own in enumerate(owners) if max(own) >= self.count}
        for i, number in varying.items():
            found = inside._run_effect(fixed, number)
            evidence[i], statistic[i] = found.gain - 0.5 * np.log(self.samples), found.statistic
            sizes[i] = np.array([found.spread])
        # all candidates with as many columns at once
        plain = [i for i in range(len(owners)) if i not in varying]
        for count in {len(owners[i]) for i in plain}:
            alike = [i for i in plain if len(owners[i]) == count]
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
        inside, fixed = self.within(chosen)
        left = inside._left(fixed, more)
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
        return dataclasses.replace(self, gram=sums.T @ self.gram @ sums, known=known, by_run=self._rows @ sums)

    def seen_from(self, keep: np.ndarray) -> "Products":
        """With sums `keep` (1 + p, 1 + m) of the residual and the free parameters in the place of these."""
        return self.mixed(np.asarray(block_diag(keep, np.eye(self.count))), keep.shape[1])

    def scaled(self, length: np.ndarray) -> "Products":
        """With every column divided by its `length`."""
        return dataclasses.replace(self, gram=self.gram / np.outer(length, length), by_run=self._rows / length)

    def weights(self, chosen: Sequence[int]) -> np.ndarray:
        """(1 + p + q,) of the columns whose sum is the residual less what parameters and `chosen` take up of it.

        Deviations by run are left in it.
        """
        inside, fixed = self.within(chosen)
        index, found = self._index(fixed), np.zeros(len(self.gram))
        found[0], found[index] = 1.0, -np.linalg.solve(inside.with_priors(fixed)[1:, 1:], inside.gram[index, 0])
        return found

    def fall(self, chosen: Sequence[int]) -> float:
        """By how much χ² falls with the candidate columns `chosen`."""
        inside, fixed = self.within(chosen)

        def left(H: np.ndarray, at: list[int]) -> float:
            return float(H[0, 0] - H[at, 0] @ np.linalg.lstsq(H[np.ix_(at, at)], H[at, 0])[0])

        return left(self.gram, self._index([])) - left(inside.gram, self._index(fixed))

    def explained(self, chosen: Sequence[int], owners: Sequence[Sequence[int]]) -> np.ndarray:
        """The share of what `chosen` leave of χ² that each further candidate explains."""
        inside, fixed = self.within(chosen)
        return self.gains(chosen, owners).statistic / max(float(inside._left(fixed, [])[0, 0]), 1e-300)

    def unabsorbed(self) -> np.ndarray:
        """(q,) squares of each candidate column that the free parameters cannot absorb."""
        return np.diag(self._left([]))[1:]

    def kept(self, owners: Sequence[Sequence[int]]) -> np.ndarray:
        """The share of each candidate's squares that the free parameters cannot absorb, the least over its columns."""
        varying = range(self.among.shape[1])
        left = np.append(self.unabsorbed(), [np.trace(self.left_by_run([], number)) for number in varying])
        own = np.append(np.diag(self.gram)[self.known :], np.einsum("rkk->k", self.among))
        share = np.where(own > 0.0, left / np.maximum(own, 1e-300), 0.0)
        return np.array([float(np.min(share[list(columns)])) for columns in owners])

    def _index(self, chosen: Sequence[int]) -> list[int]:
        """Where the free parameters and the candidate columns `chosen` are."""
        return [*range(1, self.known), *(self.known + c for c in chosen)]

    def with_priors(self, chosen: Sequence[int]) -> Float[np.ndarray, "q q"]:
        """Products of the residual, the free parameters and the `chosen` columns, with the priors of the latter.

        `chosen` has no deviations by run (`within`).
        """
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
