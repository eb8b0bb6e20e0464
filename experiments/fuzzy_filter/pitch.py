"""The paper's comparison as a distribution: overshoot, settling and steady error of each rule over many noise seeds."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.linalg import solve_triangular
from jaxtyping import Array

from jaxsub.filter import (
    AbstractNoiseRule,
    AbstractProcess,
    ConsistentFuzzyNoise,
    ConstantNoise,
    FuzzyNoise,
    InnovationNoise,
    RandomNoise,
    SageHusaNoise,
)
from jaxsub.navigation.attitude import PaperAttitude, RotationAttitude
from jaxsub.navigation.rotation import from_euler

from .bench import ATTITUDE_DENSITY, BIAS_DENSITY, DEGREE, INTERVAL, bench, filtered, pitch_of
from .claims import COMPARED, examined
from .consistency import consistency
from .pitch_figures import draw
from .pitch_runs import Runs, metrics

# degrees: the paper's Figs 2-4, 5, 6-8 and 9
ANGLES = (4.4, 17.4, 28.2, 29.1, 15.7, 3.05, 14.1, 35.1, 44.6, 45.7)
SEEDS, QUICK_SEEDS = 200, 20
Rules = Mapping[str, Callable[[Array], AbstractNoiseRule]]


def rules(process: AbstractProcess, spread: np.ndarray | None = None) -> Rules:
    """The rules by name, each made from a random key; `spread` (s,) is the root of the fuzzy rule's mean density."""
    paper = isinstance(process, PaperAttitude)
    attitude = jnp.full(4, ATTITUDE_DENSITY / 2.0) if paper else jnp.full(3, ATTITUDE_DENSITY)
    known = jnp.concatenate([attitude, jnp.full(3, BIAS_DENSITY)])
    least, most = 1e-2 * known, 1e3 * known
    of = {
        "fuzzy": lambda key: FuzzyNoise(least, most),
        "constant": lambda key: ConstantNoise(jnp.diag(known)),
        "sage_husa": lambda key: SageHusaNoise(known, least, most),
        "innovation": lambda key: InnovationNoise(least, 3),
        "consistent": lambda key: ConsistentFuzzyNoise(known),
    }
    if spread is not None:
        # "random noise in the same range": squares of uniform numbers whose mean is that of the fuzzy rule
        largest = jnp.asarray(np.sqrt(3.0) * spread)
        of["random"] = lambda key: RandomNoise(largest, jax.random.key_data(key))
    return of


def runs(process: AbstractProcess, rule: Callable[[Array], AbstractNoiseRule], seeds: int, seen: bool) -> Callable:
    """A compiled function of an angle, rad, that gives its `Runs`."""

    def once(angle: Array, key: Array) -> Runs:
        noise, draws = jax.random.split(key)
        run = bench(angle, noise, seen)
        found = filtered(process, rule(draws), run)
        whitened = jax.vmap(lambda L, v: solve_triangular(L, v, lower=True))(found.factor, found.innovation)
        nis = jnp.where(jnp.all(found.used, axis=1), jnp.sum(whitened**2, axis=1), jnp.nan)
        truth = jnp.concatenate([jax.vmap(from_euler)(run.angles), run.bias], axis=1)
        errors = jax.vmap(process.difference)(found.x, truth)
        measured, known = run.measured.angles[:, 1], run.measured.known[:, 1]
        beside = (errors, found.x_std, found.noise_std, jnp.any(found.diverged))
        return Runs._make((pitch_of(found), measured, known, nis, *beside))

    keys = jax.random.split(jax.random.key(4), seeds)
    return jax.jit(lambda angle: jax.vmap(lambda key: once(angle, key))(keys))


def run(out: Path, quick: bool) -> dict:
    """`pitch`, `claims`, `consistency`, and what they depend on."""
    seeds = QUICK_SEEDS if quick else SEEDS
    process = PaperAttitude()
    traces, per_seed = {}, {}
    for name, rule in rules(process).items():
        _collect(traces, per_seed, name, runs(process, rule, seeds, seen=False))
    spread = np.sqrt(np.mean([traces[a, "fuzzy"].noise[:, 1:] ** 2 for a in ANGLES], axis=(0, 1, 2)) / INTERVAL)
    for factor, name, angles in (
        (1.0, "random", ANGLES),
        (0.5, "random_half", COMPARED),
        (2.0, "random_double", COMPARED),
    ):
        rule = rules(process, factor * spread)["random"]
        _collect(traces, per_seed, name, runs(process, rule, seeds, seen=False), angles)
    table = {
        str(angle): {
            name: {key: _range(values) for key, values in per_seed[angle, name].items()}
            | {"diverged": int(np.sum(traces[angle, name].diverged))}
            for name in sorted(name for of, name in traces if of == angle)
        }
        for angle in ANGLES
    }
    draw(out, traces)
    rotation = RotationAttitude()
    followed = {name: runs(rotation, rule, seeds, seen=False)(14.1 * DEGREE) for name, rule in rules(rotation).items()}
    return {
        "seeds": seeds,
        "pitch": table,
        "seen_by_the_gyros": _seen(process, spread, seeds),
        "claims": examined(per_seed, traces),
        "consistency": consistency({"14.1, " + name: found for name, found in followed.items()})
        | consistency({f"{angle}, {name}, paper": found for (angle, name), found in traces.items()}),
    }


def _collect(traces: dict, per_seed: dict, name: str, of: Callable, angles: Sequence[float] = ANGLES) -> None:
    for angle in angles:
        found = jax.tree.map(np.asarray, of(angle * DEGREE))
        traces[angle, name], per_seed[angle, name] = found, metrics(found, angle * DEGREE)


def _seen(process: AbstractProcess, spread: np.ndarray, seeds: int) -> dict:
    """The same at 14.1° when the gyros see the board turn."""
    found = {name: runs(process, rule, seeds, seen=True) for name, rule in rules(process, spread).items()}
    of = {name: metrics(function(14.1 * DEGREE), 14.1 * DEGREE) for name, function in found.items()}
    return {name: {key: _range(values) for key, values in each.items()} for name, each in of.items()}


def _range(values: np.ndarray) -> dict[str, float]:
    low, middle, high = np.percentile(values, [5, 50, 95])
    return {"median": float(middle), "p5": float(low), "p95": float(high)}
