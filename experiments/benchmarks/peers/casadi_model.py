"""The vehicle in CasADi: a step, its derivatives, a likelihood, its gradient and normal equations; in C where asked.

`rk4` is the step that a user writes. `etdrk4` is this library's own, exact for the linear part (Cox and Matthews 2002).
"""

import dataclasses
import shutil
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from ..case import Case
from . import equations

# what the hull's symmetry decouples
_BLOCKS = ((0,), (1, 3, 5), (2, 4))
_TERMS, _DOUBLINGS = 10, 12
_TRIG = (ca.sin, ca.cos)
_FLAGS = ("-O3", "-march=native", "-ffast-math", "-shared", "-fPIC")


@dataclasses.dataclass(frozen=True)
class Model:
    """The vehicle of a case; `scheme` is "rk4" with `substeps` or "etdrk4" with one."""

    case: Case
    scheme: str = "rk4"
    substeps: int = 1

    def prepare(self, y: ca.SX) -> tuple[dict[str, ca.SX], ca.SX, ca.SX]:
        """At the coordinates y (p,) of the coefficients: the numbers, the inverse inertia and the linear part."""
        scale = np.abs(self.case.centre)
        values = {name: ca.SX(value) for name, value in self.case.values.items()}
        for index, name in enumerate(self.case.names):
            values[name] = self.case.centre[index] + scale[index] * y[index]
        mass, damping = (_matrix(of(values)) for of in (equations.mass_matrix, equations.damping_matrix))
        inverse = ca.SX(6, 6)
        for block in _BLOCKS:
            rows = list(block)
            inverse[rows, rows] = ca.inv_minor(ca.densify(mass[rows, rows]))
        return values, inverse, inverse @ damping

    def step(self) -> ca.Function:
        """(x, fins, W) to the state one sample later; W is what `weights` gives."""
        x, fins = ca.SX.sym("x", 10), ca.SX.sym("fins", 3)
        y = ca.SX.sym("y", len(self.case.names))
        values, inverse, linear = self.prepare(y)
        sizes = [values[name] for name in _FORCES]
        parts = [ca.vertcat(*sizes), _nonzeros(inverse), _nonzeros(linear), *self._tables(linear)]
        symbols = [ca.SX.sym(f"w{i}", part.shape[0]) for i, part in enumerate(parts)]
        named = {n: ca.SX(v) for n, v in self.case.values.items()} | dict(
            zip(_FORCES, ca.vertsplit(symbols[0]), strict=True)
        )
        inverse_of = ca.SX(inverse.sparsity(), symbols[1])
        linear_of = ca.SX(linear.sparsity(), symbols[2])

        def rates(state: ca.SX, whole: bool) -> ca.SX:
            entries = ca.vertsplit(state)
            push = inverse_of @ ca.vertcat(*equations.force(named, entries, ca.vertsplit(fins), _TRIG))
            push = push + linear_of @ state[:6] if whole else push
            return ca.vertcat(push, *equations.position_rates(entries, _TRIG))

        after = self._rk4(x, rates) if self.scheme == "rk4" else self._etdrk4(x, rates, linear, symbols[3:])
        return ca.Function("step", [x, fins, ca.vertcat(*symbols)], [after])

    def weights(self) -> ca.Function:
        """Coordinates (p,) to the numbers that every step of a simulation uses."""
        y = ca.SX.sym("y", len(self.case.names))
        values, inverse, linear = self.prepare(y)
        sizes = ca.vertcat(*[values[name] for name in _FORCES])
        return ca.Function("weights", [y], [
            ca.vertcat(sizes, _nonzeros(inverse), _nonzeros(linear), *self._tables(linear))
        ])  # fmt: skip

    def _rk4(self, x: ca.SX, rates) -> ca.SX:
        h = self.case.interval / self.substeps
        for _ in range(self.substeps):
            k1 = rates(x, True)
            k2 = rates(x + 0.5 * h * k1, True)
            k3 = rates(x + 0.5 * h * k2, True)
            k4 = rates(x + h * k3, True)
            x = x + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
        return x

    def _etdrk4(self, x: ca.SX, rates, linear: ca.SX, symbols: list[ca.SX]) -> ca.SX:
        h = self.case.interval
        full, half, stage, first, middle, last = (ca.SX(_closure(linear), s) for s in symbols)
        flow = lambda matrix, k, share: ca.vertcat(matrix @ k[:6], share * h * k[6:])
        n0 = rates(x, False)
        begun = ca.vertcat(half @ x[:6], x[6:])
        a = begun + flow(stage, n0, 0.5)
        n1 = rates(a, False)
        b = begun + flow(stage, n1, 0.5)
        n2 = rates(b, False)
        c = ca.vertcat(half @ a[:6] + stage @ (2.0 * n2 - n0)[:6], x[6:] + h * n2[6:])
        n3 = rates(c, False)
        velocity = full @ x[:6] + first @ n0[:6] + middle @ (n1 + n2)[:6] + last @ n3[:6]
        return ca.vertcat(velocity, x[6:] + h / 6.0 * (n0 + 2.0 * (n1 + n2) + n3)[6:])

    def _tables(self, linear: ca.SX) -> list[ca.SX]:
        """Weights of the exponential scheme, entry by entry; none for Runge and Kutta's."""
        if self.scheme == "rk4":
            return []
        h = self.case.interval
        half, p1_half, _, _ = _phi(0.5 * h * linear)
        full, p1, p2, p3 = _phi(h * linear)
        tables = [full, half, 0.5 * h * p1_half]
        tables += [h * (p1 - 3.0 * p2 + 4.0 * p3), h * (2.0 * p2 - 4.0 * p3), h * (4.0 * p3 - p2)]
        return [_nonzeros(ca.project(table, _closure(linear))) for table in tables]


_FORCES = ("X_0", "Y_delta_r", "N_delta_r", "Z_delta_e", "M_delta_e", "K_delta_er", "K_delta_el")


def trajectory(model: Model) -> ca.Function:
    """(y, x0, fins) to the states at the K samples of one run, (10, K)."""
    y, x0 = ca.MX.sym("y", len(model.case.names)), ca.MX.sym("x0", 10)
    count = model.case.fins.shape[1] - 1
    fins = ca.MX.sym("fins", 3, count)
    w = model.weights()(y)
    after = model.step().mapaccum("run", count)(x0, fins, ca.repmat(w, 1, count))
    return ca.Function("trajectory", [y, x0, fins], [ca.horzcat(x0, after)])


def cost(model: Model) -> ca.Function:
    """Coordinates (d,) to minus the log-likelihood with its priors: R runs, sensors as they are."""
    case = model.case
    p, runs = len(case.names), len(case.fins)
    z = ca.MX.sym("z", case.size)
    moved = ca.reshape(z[p:], 10, runs)
    of = trajectory(model)
    total = 0.5 * ca.sumsqr(prior(case, z[:p])) + 0.5 * ca.sumsqr(moved)
    for run in range(runs):
        states = of(z[:p], case.guess[run] + case.spread * moved[:, run], case.fins[run, :-1].T)
        total += 0.5 * ca.sumsqr((case.measured[run].T - states) / case.sigma)
    return ca.Function("cost", [z], [total])


def with_gradient(of: ca.Function) -> ca.Function:
    """Coordinates to the cost and its gradient, by reverse mode."""
    z = ca.MX.sym("z", of.size1_in(0))
    value = of(z)
    return ca.Function("with_gradient", [z], [value, ca.gradient(value, z)])


def sensitivities(model: Model) -> ca.Function:
    """(y, x0, fins) to one run's states (10, K-1) after the first and their sensitivities to (y, x0), by recursion.

    A step's Jacobians are those of its expression graph, zeros left out, so this is forward mode at its cheapest.
    """
    case = model.case
    p = len(case.names)
    x, fins, y = ca.SX.sym("x", 10), ca.SX.sym("fins", 3), ca.SX.sym("y", p)
    S = ca.SX.sym("S", 10, p + 10)
    step = model.step()
    w = ca.SX.sym("w", step.size1_in(2))
    dw = ca.SX.sym("dw", ca.jacobian(model.weights()(y), y).sparsity())
    after = step(x, fins, w)
    by_theta = ca.jacobian(after, w) @ dw
    S_after = ca.jacobian(after, x) @ S + ca.horzcat(by_theta, ca.SX(10, 10))
    inputs, outputs = [x, S, fins, w, dw], [after, ca.densify(S_after)]
    one = ca.Function("one", inputs, ca.cse(outputs))
    count = case.fins.shape[1] - 1
    Y, X0, F = ca.MX.sym("y", p), ca.MX.sym("x0", 10), ca.MX.sym("fins", 3, count)
    weights = model.weights()(Y)
    slopes = ca.jacobian(weights, Y)
    begin = ca.DM(np.concatenate([np.zeros((10, p)), np.eye(10)], axis=1))
    whole = one.mapaccum("run", count, 2)
    states, S_all = whole(X0, begin, F, ca.repmat(weights, 1, count), ca.repmat(slopes, 1, count))
    return ca.Function("sensitivities", [Y, X0, F], [states, S_all])


def in_c(of: ca.Function, folder: Path, derivatives: bool = False) -> tuple[ca.Function, dict[str, float]]:
    """The function compiled by the machine's C compiler, and the seconds that generating and compiling took.

    With `derivatives` its Jacobian is compiled too, and CasADi finds it where it differentiates.
    """
    begin = time.perf_counter()
    source = ca.CodeGenerator(of.name(), {"with_header": False})
    source.add(of)
    if derivatives:
        source.add(of.jacobian())
    work = Path(tempfile.mkdtemp(dir=folder))
    source.generate(f"{work}/")
    generated = time.perf_counter() - begin
    taken = compiled(work / f"{of.name()}.c")
    return ca.external(of.name(), str(work / f"{of.name()}.so")), {"generate_s": generated, "compile_s": taken}


def compiled(source: Path) -> float:
    """Make a library beside a C file; the seconds that took."""
    begin = time.perf_counter()
    command = [compiler(), *_FLAGS, str(source), "-o", str(source.with_suffix(".so")), "-lm"]
    subprocess.run(command, check=True, capture_output=True)
    return time.perf_counter() - begin


def compiler() -> str:
    """The C compiler."""
    found = shutil.which("gcc") or shutil.which("clang")
    assert found, "CasADi's C needs gcc or clang"
    return found


def prior(case: Case, y: Any) -> Any:
    """What the priors add to the residuals."""
    pull = (case.centre + np.abs(case.centre) * y - case.prior_mean) / case.prior_std
    return pull[np.flatnonzero(np.isfinite(case.prior_std)).tolist()]


def _matrix(rows: equations.Matrix) -> ca.SX:
    """A matrix whose absent entries are structural zeros."""
    matrix = ca.SX(6, 6)
    for i, row in enumerate(rows):
        for j, entry in enumerate(row):
            if not (isinstance(entry, float) and entry == 0.0):
                matrix[i, j] = entry
    return ca.sparsify(matrix)


def _nonzeros(matrix: Any) -> ca.SX:
    return ca.vertcat(*matrix.nonzeros())


def _closure(linear: ca.SX) -> ca.Sparsity:
    """Where functions of a matrix have entries."""
    pattern = ca.DM(linear.sparsity(), 1.0) + ca.DM.eye(6)
    return ca.sparsify(pattern @ pattern @ pattern).sparsity()


def _phi(A: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
    """exp(A) and the first three phi functions, by Taylor series and doubling."""
    eye = ca.SX.eye(6)
    small = A / 2**_DOUBLINGS
    terms = [eye, eye, eye / 2.0, eye / 6.0]
    e, p1, p2, p3 = terms
    for j in range(1, _TERMS):
        terms = [term @ small / (j + k) for k, term in enumerate(terms)]
        e, p1, p2, p3 = e + terms[0], p1 + terms[1], p2 + terms[2], p3 + terms[3]
    for _ in range(_DOUBLINGS):
        e, p1, p2, p3 = (
            e @ e,
            (e @ p1 + p1) / 2.0,
            (e @ p2 + p1 + p2) / 4.0,
            (e @ p3 + p1 / 2.0 + p2 + p3) / 8.0,
        )
    return e, p1, p2, p3
