"""Fits with SciPy: `least_squares` on `solve_ivp`, as users write it and as an expert in NumPy would.

Fins are held, so the solver is started again wherever one moves: an adaptive step across a jump would cost more and be
wrong. Tolerances give the outputs to about a ten-thousandth of their noise, as this library's own step does.
"""

import itertools
import time

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

from ..case import Case
from . import equations
from .damped import End

TOLERANCE = {"method": "DOP853", "rtol": 1e-7, "atol": 1e-9}
_DIFFERENCE = 1e-5
_TRIG = (np.sin, np.cos)


class TimeLimitError(Exception):
    """The fit takes longer than it was given."""


class Serial:
    """One run after the other, the Jacobian by `least_squares`' own differences."""

    def __init__(self, case: Case, limit: float = np.inf):
        self.case, self.limit, self.evaluations, self.begin = case, limit, 0, 0.0

    def states(self, z: np.ndarray, run: int) -> np.ndarray:
        """(K, 10) of one run."""
        case, p = self.case, len(self.case.names)
        values, inverse, linear = _matrices(case, z[:p])

        def rates(_: float, x: np.ndarray, fins: np.ndarray) -> np.ndarray:
            push = inverse @ np.array(equations.force(values, x, fins, _TRIG)) + linear @ x[:6]
            return np.concatenate([push, equations.position_rates(x, _TRIG)])

        own = z[p + 10 * run : p + 10 * run + 10]
        start = case.guess[run] + case.spread * own
        return _driven(rates, start, case.fins[run : run + 1], case.interval, lambda fins: fins[0])

    def residuals(self, z: np.ndarray) -> np.ndarray:
        """Whitened errors and priors."""
        self.evaluations += 1
        if self.begin and time.perf_counter() - self.begin > self.limit:
            raise TimeLimitError
        shown = np.stack([self.states(z, run) for run in range(len(self.case.fins))])
        return np.concatenate([((shown - self.case.measured) / self.case.sigma).ravel(), _priors(self.case, z)])

    def fit(self, z: np.ndarray) -> End:
        """The end of the search from `z`. **Raises** `TimeLimitError` beyond its limit."""
        self.evaluations, self.begin = 0, time.perf_counter()
        found = least_squares(self.residuals, z, diff_step=_DIFFERENCE, ftol=1e-8, xtol=1e-10, x_scale="jac")
        return End(found.x, float(found.cost), self.evaluations)


class Stacked:
    """All runs and all differences of a Jacobian in one call of the solver: the equations on arrays."""

    def __init__(self, case: Case):
        self.case, self.evaluations = case, 0

    def states(self, z: np.ndarray) -> np.ndarray:
        """(B, R, K, 10) from the coordinates (B, d)."""
        case, p = self.case, len(self.case.names)
        values, inverse, linear = _matrices(case, z[:, :p])
        starts = case.guess + case.spread * z[:, p:].reshape(len(z), *case.guess.shape)
        shape = (10, len(case.fins), len(z))

        def rates(_: float, x: np.ndarray, fins: np.ndarray) -> np.ndarray:
            x = x.reshape(shape)
            entries = np.broadcast_arrays(*equations.force(values, x, fins[..., None], _TRIG))
            push = inverse @ np.stack(entries).transpose(2, 0, 1) + linear @ x[:6].transpose(2, 0, 1)
            return np.concatenate([push.transpose(1, 2, 0), equations.position_rates(x, _TRIG)]).ravel()

        states = _driven(rates, starts.transpose(2, 1, 0).ravel(), case.fins, case.interval, lambda fins: fins.T)
        return states.reshape(-1, *shape).transpose(3, 2, 0, 1)

    def residuals(self, z: np.ndarray) -> np.ndarray:
        """Whitened errors and priors."""
        self.evaluations += 1
        return self._whitened(z, self.states(z[None])[0])

    def jacobian(self, z: np.ndarray) -> np.ndarray:
        """By differences; one of an initial state serves every run, for runs do not feel each other's."""
        case, p = self.case, len(self.case.names)
        runs = len(case.fins)
        moves = np.concatenate([np.eye(p, case.size), np.tile(np.eye(10), (1, runs)) @ _after(p, case.size)])
        shown = self.states(np.concatenate([z[None], z + _DIFFERENCE * moves]))
        by = (shown[1:] - shown[0]) / _DIFFERENCE / case.sigma
        J = np.zeros((*shown.shape[1:], case.size))
        J[..., :p] = np.moveaxis(by[:p], 0, -1)
        for run in range(runs):
            J[run, ..., p + 10 * run : p + 10 * run + 10] = np.moveaxis(by[p:, run], 0, -1)
        slopes = np.diag(_priors(case, np.ones(case.size)) - _priors(case, np.zeros(case.size)))
        known = np.concatenate([np.flatnonzero(np.isfinite(case.prior_std)), np.arange(p, case.size)])
        lower = np.zeros((len(known), case.size))
        lower[:, known] = slopes
        return np.concatenate([J.reshape(-1, case.size), lower])

    def fit(self, z: np.ndarray) -> End:
        """The end of the search from `z`."""
        self.evaluations = 0
        found = least_squares(self.residuals, z, self.jacobian, ftol=1e-8, xtol=1e-10, x_scale="jac")  # pyright: ignore
        return End(found.x, float(found.cost), self.evaluations)

    def _whitened(self, z: np.ndarray, shown: np.ndarray) -> np.ndarray:
        return np.concatenate([((shown - self.case.measured) / self.case.sigma).ravel(), _priors(self.case, z)])


def _driven(rates, start: np.ndarray, fins: np.ndarray, interval: float, pick) -> np.ndarray:
    """(K, n) states at the samples, the solver started again wherever a fin of any run moves."""
    K = fins.shape[1]
    moves = np.flatnonzero(np.any(np.diff(fins[:, :-1], axis=1) != 0.0, axis=(0, 2))) + 1
    edges = [0, *moves.tolist(), K - 1]
    found = np.empty((K, len(start)))
    found[0] = start
    for begin, end in itertools.pairwise(edges):
        at = interval * np.arange(end - begin + 1)
        fixed = pick(fins[:, begin])
        solution = solve_ivp(rates, (0.0, at[-1]), found[begin], t_eval=at[1:], args=(fixed,), **TOLERANCE)
        found[begin + 1 : end + 1] = solution.y.T
    return found


def _matrices(case: Case, y: np.ndarray) -> tuple[dict[str, np.ndarray], np.ndarray, np.ndarray]:
    """Numbers by name, inverse inertia and linear part at the coordinates (..., p)."""
    theta = case.centre + np.abs(case.centre) * y
    values = {name: np.asarray(value) for name, value in case.values.items()}
    values |= {name: theta[..., index] for index, name in enumerate(case.names)}
    filled = lambda rows: np.stack([np.stack(np.broadcast_arrays(*row, theta[..., 0])[:6], -1) for row in rows], -2)
    inverse = np.linalg.inv(filled(equations.mass_matrix(values)))
    return values, inverse, inverse @ filled(equations.damping_matrix(values))


def _priors(case: Case, z: np.ndarray) -> np.ndarray:
    p = len(case.names)
    theta = case.centre + np.abs(case.centre) * z[:p]
    known = np.isfinite(case.prior_std)
    return np.concatenate([((theta - case.prior_mean) / case.prior_std)[known], z[p:]])


def _after(p: int, size: int) -> np.ndarray:
    """(size - p, size) that puts entries behind the first p."""
    return np.eye(size)[p:]
