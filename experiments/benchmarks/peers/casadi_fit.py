"""Fits with CasADi: multiple shooting by IPOPT, and single shooting by damped Gauss-Newton steps on generated C."""

import time
from pathlib import Path

import casadi as ca
import numpy as np

from ..case import Case
from .casadi_model import Model, in_c, prior, sensitivities
from .damped import End, minimise


class SingleShooting:
    """Cost, gradient and curvature of a case from the C that CasADi generates for a run and its sensitivities."""

    def __init__(self, model: Model, folder: Path | None):
        self.case = model.case
        function = sensitivities(model)
        # without a folder to compile in it is CasADi's own machine that evaluates
        self.function, self.compile = in_c(function, folder) if folder else (function, {})
        # CasADi's own conversion to NumPy takes eight times what the C does: it writes into our memory instead
        p, count = len(self.case.names), self.case.measured.shape[1] - 1
        self.given = [np.zeros(p), np.zeros(10), np.zeros((count, 3))]
        self.states, self.columns = np.zeros((count, 10)), np.zeros((count, p + 10, 10))
        self.buffer, self.evaluate = self.function.buffer()
        for index, array in enumerate(self.given):
            self.buffer.set_arg(index, memoryview(array))  # pyright: ignore
        for index, array in enumerate((self.states, self.columns)):
            self.buffer.set_res(index, memoryview(array))  # pyright: ignore

    def expand(self, z: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        """The cost (priors included), its gradient (d,) and J^T J (d, d) at the coordinates `z`."""
        case, p = self.case, len(self.case.names)
        runs = len(case.measured)
        known, pull, slope = _prior(case, z[:p])
        gradient, curvature = np.zeros(case.size), np.eye(case.size)
        curvature[:p, :p] = 0.0
        gradient[p:] = z[p:]
        gradient[known] = pull * slope
        curvature[known, known] = slope**2
        cost = 0.5 * (pull @ pull + z[p:] @ z[p:])
        for run in range(runs):
            own = np.arange(p + 10 * run, p + 10 * run + 10)
            start = case.guess[run] + case.spread * z[own]
            for array, value in zip(self.given, (z[:p], start, case.fins[run, :-1]), strict=True):
                array[:] = value
            self.evaluate()
            error = (self.states - case.measured[run, 1:]) / case.sigma
            J, flat = self.columns / case.sigma, error.ravel()
            J[:, p:] *= case.spread[:, None]
            J = np.moveaxis(J, 1, 2).reshape(-1, p + 10)
            chosen = np.concatenate([np.arange(p), own])
            curvature[np.ix_(chosen, chosen)] += J.T @ J
            gradient[chosen] += J.T @ flat
            first, weight = (start - case.measured[run, 0]) / case.sigma, case.spread / case.sigma
            gradient[own] += weight * first
            curvature[own, own] += weight**2
            cost += 0.5 * (flat @ flat + first @ first)
        return float(cost), gradient, curvature

    def fit(self, z: np.ndarray) -> End:
        """The end of the search from `z`."""
        return minimise(self.expand, z)


class MultipleShooting:
    """IPOPT on all states at every `stride`-th sample, with the Gauss-Newton curvature, as CasADi's own example has it.

    What happens between nodes, and its Jacobian, is generated C; the sparse linear algebra is IPOPT's MUMPS. The C of
    the whole problem runs to 57 MB at a stride of one, which gcc does not finish in minutes.
    """

    def __init__(self, model: Model, folder: Path, stride: int):
        case = model.case
        begin = time.perf_counter()
        p, (runs, K) = len(case.names), case.measured.shape[:2]
        pieces = (K - 1) // stride
        step, weights = model.step(), model.weights()
        x, fins, w = ca.MX.sym("x", 10), ca.MX.sym("fins", 3, stride), ca.MX.sym("w", step.size1_in(2))
        piece = ca.Function("piece", [x, fins, w], [step.mapaccum("part", stride)(x, fins, ca.repmat(w, 1, stride))])
        piece, self.compile = in_c(piece, folder, derivatives=True)
        y = ca.MX.sym("y", p)
        nodes = [ca.MX.sym(f"X{run}", 10, pieces + 1) for run in range(runs)]
        scale = case.sigma * 10.0
        residuals, gaps = [prior(case, y)], []
        wide = ca.repmat(weights(y), 1, pieces)
        for run in range(runs):
            states = nodes[run] * scale
            driven = case.fins[run, : pieces * stride].T
            columns = np.concatenate(np.split(driven, pieces, axis=1), axis=0).reshape(pieces, 3, stride)
            across = ca.DM(np.concatenate(list(columns), axis=1))
            after = piece.map(pieces)(states[:, :-1], across, wide)
            ends = after[:, stride - 1 :: stride]
            gaps.append(ca.vec((ends - states[:, 1:]) / scale))
            shown = ca.horzcat(states[:, 0], after)
            residuals.append(ca.vec((shown - case.measured[run, : pieces * stride + 1].T) / case.sigma))
            # what remains after the last whole piece is run on from the last node
            rest = K - 1 - pieces * stride
            if rest:
                driven = case.fins[run, pieces * stride : K - 1].T
                last = step.mapaccum("rest", rest)(states[:, -1], driven, ca.repmat(weights(y), 1, rest))
                residuals.append(ca.vec((last - case.measured[run, -rest:].T) / case.sigma))
            residuals.append((states[:, 0] - case.guess[run]) / case.spread)
        V = ca.veccat(y, *nodes)
        e = ca.vertcat(*residuals)
        nlp = {"x": V, "f": 0.5 * ca.dot(e, e), "g": ca.vertcat(*gaps)}
        J = ca.jacobian(e, V)
        # the curvature of the constraints is neglected with that of the residuals: Gauss and Newton's
        weight, multipliers = ca.MX.sym("s"), ca.MX.sym("l", nlp["g"].size1())
        H = ca.Function("curvature", [V, ca.MX(0, 1), weight, multipliers], [weight * ca.triu(J.T @ J)])
        # states start at what was measured, as is usual
        self.start = (case.measured[:, : pieces * stride + 1 : stride] / scale).ravel()
        self.case, self.scale, self.pieces = case, scale, pieces
        options = {"ipopt.print_level": 0, "print_time": False, "ipopt.sb": "yes", "ipopt.tol": 1e-6, "hess_lag": H}
        options |= {"ipopt.max_iter": 100, "ipopt.mu_init": 1e-6}
        self.solver = ca.nlpsol("fit", "ipopt", nlp, options)
        self.compile |= {"build_s": time.perf_counter() - begin - sum(self.compile.values())}

    def fit(self, z: np.ndarray) -> End:
        """The end of the search from the coefficients of `z`; states begin at the recording."""
        case, p = self.case, len(self.case.names)
        found = self.solver(x0=np.concatenate([z[:p], self.start]), lbg=0.0, ubg=0.0)
        V = np.array(found["x"]).ravel()
        nodes = V[p:].reshape(len(case.fins), self.pieces + 1, 10) * self.scale
        moved = (nodes[:, 0] - case.guess) / case.spread
        return End(np.concatenate([V[:p], moved.ravel()]), float(found["f"]), self.solver.stats()["iter_count"])


def _prior(case: Case, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    known = np.flatnonzero(np.isfinite(case.prior_std))
    scale = np.abs(case.centre[known])
    pull = (case.centre[known] + scale * y[known] - case.prior_mean[known]) / case.prior_std[known]
    return known, pull, scale / case.prior_std[known]
