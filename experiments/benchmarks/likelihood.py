"""A likelihood, its gradient and its forward Jacobian, one and a batch, beside CasADi's and the floor."""

import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from jaxsub.estimate import Problem

from .case import Case, problem_and_case
from .ours import cost, expansion, forward_jacobian, points, with_gradient
from .peers import casadi_model
from .peers.peak import peak_flops
from .timing import a_member, in_turn, once, pin

_CORES = 2


def single(out: Path, quick: bool) -> dict:
    """One evaluation at a time, every peer on the same one core."""
    pin(1)
    problem, case = problem_and_case()
    fast, made_s = once(problem.in_c)
    z = points(case, 1)[0]
    model = casadi_model.Model(case)
    scalar, slope = (f(model) for f in (casadi_model.cost, lambda m: casadi_model.with_gradient(casadi_model.cost(m))))
    columns = casadi_model.sensitivities(model)
    with tempfile.TemporaryDirectory() as folder:
        generated: dict = {}
        compile_s: dict = {"jaxsub in C": made_s}
        for name, of in {"likelihood": scalar, "gradient": slope, "columns": columns}.items():
            generated[name], compile_s[f"CasADi C {name}"] = casadi_model.in_c(of, Path(folder))
        run = (z[: len(case.names)], case.guess[0], case.fins[0, :-1].T)
        every = lambda of: [of(*run) for _ in case.fins]
        at = jnp.asarray(z)
        calls = {
            "jaxsub likelihood": lambda: cost(problem, at),
            "jaxsub in C likelihood": lambda: cost(fast, at),
            "CasADi VM likelihood": lambda: scalar(z),
            "CasADi C likelihood": lambda: generated["likelihood"](z),
            "jaxsub gradient": lambda: with_gradient(problem, at),
            "CasADi VM gradient": lambda: slope(z),
            "CasADi C gradient": lambda: generated["gradient"](z),
            "jaxsub forward Jacobian": lambda: forward_jacobian(problem, at),
            "jaxsub Gauss-Newton step": lambda: expansion(problem, at),
            "jaxsub in C Gauss-Newton step": lambda: expansion(fast, at),
            "CasADi VM sensitivities": lambda: every(columns),
            "CasADi C sensitivities": lambda: every(generated["columns"]),
        }
        found = in_turn(calls, 3 if quick else 15)
        agree = agreement(problem, case, z)
        peak = peak_flops(Path(folder), 3_000_000 if quick else 30_000_000)
    ratio = lambda one, other: found[one]["s"] / found[other]["s"]
    return {
        "cores": 1,
        "seconds": found,
        "compile_s": compile_s,
        "agreement": agree,
        "ratios": {
            "likelihood_over_CasADi_C": ratio("jaxsub likelihood", "CasADi C likelihood"),
            "likelihood_in_C_over_CasADi_C": ratio("jaxsub in C likelihood", "CasADi C likelihood"),
            "Gauss_Newton_step_in_C_over_CasADi_C": ratio("jaxsub in C Gauss-Newton step", "CasADi C sensitivities"),
            "Gauss_Newton_step_in_C_in_simulations_in_C": ratio(
                "jaxsub in C Gauss-Newton step", "jaxsub in C likelihood"
            ),
            "gradient_over_CasADi_C": ratio("jaxsub gradient", "CasADi C gradient"),
            "forward_jacobian_in_simulations": ratio("jaxsub forward Jacobian", "jaxsub likelihood"),
            "gauss_newton_step_in_simulations": ratio("jaxsub Gauss-Newton step", "jaxsub likelihood"),
            "CasADi_C_sensitivities_in_simulations": ratio("CasADi C sensitivities", "CasADi C likelihood"),
        },
        "floor": floor(model, peak),
    }


def batched(out: Path, quick: bool) -> dict:
    """A batch on two cores: ours in two threads, CasADi's C mapped over two threads."""
    pin(_CORES)
    problem, case = problem_and_case()
    fast = problem.in_c()
    count = 16 if quick else 256
    z = points(case, count)
    halves = jnp.asarray(np.split(z, _CORES))
    found: dict = {"cores": _CORES, "members": count, "seconds_a_member": {}}
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(_CORES) as threads:
        scalar = casadi_model.cost(casadi_model.Model(case))
        # in C the gradient comes with the products of a Gauss-Newton step
        for name, ours, in_c, theirs in (
            ("likelihood", cost, cost, scalar),
            ("gradient", with_gradient, expansion, casadi_model.with_gradient(scalar)),
        ):
            one, _ = casadi_model.in_c(theirs, Path(folder))
            mapped = one.map(count, "thread", _CORES)
            both = lambda f, of: list(threads.map(lambda half: jax.block_until_ready(f(of, half)), halves))
            rows = in_turn(
                {
                    "jaxsub in C, two threads": lambda in_c=in_c, both=both: both(in_c, fast),
                    "jaxsub, two threads": lambda ours=ours, both=both: both(ours, problem),
                    "jaxsub, one program": lambda ours=ours: ours(problem, jnp.asarray(z)),
                    "CasADi C, two threads": lambda mapped=mapped: mapped(z.T),
                },
                2 if quick else 7,
            )
            each = {key: a_member(row, count) for key, row in rows.items()}
            peer = each["CasADi C, two threads"]["s"]
            found["seconds_a_member"][name] = each
            found[f"{name}_over_CasADi_C"] = each["jaxsub, two threads"]["s"] / peer
            found[f"{name}_in_C_over_CasADi_C"] = each["jaxsub in C, two threads"]["s"] / peer
    return found


def agreement(problem: Problem, case: Case, z: np.ndarray) -> dict[str, float]:
    """How far CasADi's cost and gradient are from ours, relative: its step and ours, and ours written in CasADi."""
    ours, slope = with_gradient(problem, jnp.asarray(z))
    found = {}
    for label, model in {
        "rk4": casadi_model.Model(case),
        "our scheme": casadi_model.Model(case, "etdrk4"),
    }.items():
        theirs, theirs_slope = casadi_model.with_gradient(casadi_model.cost(model))(z)
        found[f"{label}: cost"] = abs(float(theirs) / float(ours) - 1.0)
        apart = np.asarray(theirs_slope).ravel() - np.asarray(slope)
        found[f"{label}: gradient"] = float(np.abs(apart).max() / np.abs(np.asarray(slope)).max())
    return found


def floor(model: casadi_model.Model, peak: float) -> dict[str, float]:
    """Operations of a likelihood with zeros left out, and the seconds they take at a core's best rate.

    Counted on the expression graph of one step, sines and cosines as one each; an output takes four more.
    """
    step = model.step()
    count = step.n_instructions() - step.nnz_in() - step.nnz_out()
    runs, samples, channels = model.case.measured.shape
    flops = runs * ((samples - 1) * count + 4 * samples * channels)
    own = casadi_model.Model(model.case, "etdrk4").step()
    ours = own.n_instructions() - own.nnz_in() - own.nnz_out()
    return {"operations_a_step": count, "of_our_scheme": ours, "flops": flops, "peak_flops": peak, "s": flops / peak}
