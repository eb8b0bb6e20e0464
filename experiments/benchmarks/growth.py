"""How time and memory grow: with samples, members of a batch, coefficients and candidates."""

import json
import resource
import subprocess
import sys
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxsub.discrepancy.linearise.view import facts, look
from jaxsub.effects import candidates
from jaxsub.estimate import Problem, fit
from jaxsub.estimate.method import costs, lanes_for

from .case import problem_and_case
from .diagnosis import score
from .setup import recordings_and_vehicle
from .timing import slope, timed

_SAMPLES, _MEMBERS, _FREE = (400, 800, 1600, 3200), (16, 32, 64, 128), (5, 10, 15, 20, 25)
_CANDIDATES = (50, 100, 200, 400)


def run(out: Path, quick: bool) -> dict:
    """Seconds, bytes and log-log slopes of each."""
    few = slice(0, 2) if quick else slice(None)
    return {
        "samples": _grown(_SAMPLES[few], quick, lambda size: _likelihood(size, 25)),
        "batch": _grown(_MEMBERS[few], quick, _batch) | {"peak_GB": _peaks(_MEMBERS[few])},
        "coefficients": _grown(_FREE[:: 4 if quick else 1], quick, lambda size: _step(size)),
        "candidates": _candidates(_CANDIDATES[few], quick),
    }


def _grown(sizes: tuple[int, ...], quick: bool, made) -> dict:
    """Rows of seconds and temporary bytes of the program that `made` gives for each size."""
    rows = {}
    for size in sizes:
        program, arguments = made(size)
        compiled = jax.jit(program).lower(*arguments).compile()
        memory = compiled.memory_analysis()
        row = timed(lambda compiled=compiled, arguments=arguments: compiled(*arguments), 3 if quick else 9)
        rows[str(size)] = row | {"temporary_MB": memory.temp_size_in_bytes / 1e6 if memory else float("nan")}
    of = lambda key: [row[key] for row in rows.values()]
    return {
        "rows": rows,
        "slope_of_time": slope(list(sizes), of("s")),
        "slope_of_memory": slope(list(sizes), of("temporary_MB")),
    }


def _likelihood(samples: int, free: int):
    problem, _ = problem_and_case(samples, 3, free)
    arrays, static = eqx.partition(problem, eqx.is_array)
    program = lambda arrays, z: eqx.combine(arrays, static).cost(z)
    return program, (arrays, problem.coordinates())


def _batch(members: int):
    problem, case = problem_and_case()
    arrays, static = eqx.partition(problem, eqx.is_array)
    lanes = lanes_for(problem)

    def program(arrays, z: jax.Array) -> jax.Array:
        whole: Problem = eqx.combine(arrays, static)
        return costs(lambda _: whole, z, lanes)

    z = 0.01 * np.random.default_rng(2).standard_normal((members, case.size))
    return program, (arrays, jnp.asarray(z))


def _step(free: int):
    problem, _ = problem_and_case(800, 3, free)
    arrays, static = eqx.partition(problem, eqx.is_array)
    program = lambda arrays, z: eqx.combine(arrays, static).expand(z).hessian
    return program, (arrays, problem.coordinates())


def _candidates(sizes: tuple[int, ...], quick: bool) -> dict:
    vehicle, recordings = recordings_and_vehicle()
    view = look(fit(vehicle, recordings))
    listed = candidates(facts(view))
    # in the vocabulary's order the first would be forces, and the dearer actuators and sensors the last
    order = np.random.default_rng(3).permutation(len(listed))
    listed = [listed[i] for i in order]
    rows = {str(n): timed(lambda n=n: score(view, listed[:n]), 3 if quick else 7) for n in sizes}
    return {"rows": rows, "slope_of_time": slope(list(sizes), [row["s"] for row in rows.values()])}


def _peaks(sizes: tuple[int, ...]) -> dict[str, float]:
    """Peak memory of a process that evaluates so many members, for the least and the most."""
    command = [sys.executable, "-m", "experiments.benchmarks.growth"]
    printed = lambda n: subprocess.run([*command, str(n)], check=True, capture_output=True).stdout
    return {str(n): json.loads(printed(n)) for n in (sizes[0], sizes[-1])}


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    _program, _arguments = _batch(int(sys.argv[1]))
    jax.block_until_ready(jax.jit(_program)(*_arguments))
    sys.stdout.write(json.dumps(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6))
