"""Every filter in 32 bits beside itself in 64: how far its estimates are apart, and whether P stays positive definite.

Everything is rounded to 32 bits, inputs and the filter's own numbers too. P is scaled by its standard deviations first;
that of a square root has the squares of the root's singular values for eigenvalues, which no rounding makes negative.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from jax.typing import DTypeLike
from scipy.spatial.transform import Rotation

from jaxsub.filter import (
    AbstractFilter,
    AbstractForm,
    AbstractNoiseRule,
    AbstractProcess,
    ConsistentFuzzyNoise,
    ConstantNoise,
    Covariance,
    ExtendedKalmanFilter,
    FuzzyNoise,
    ModifiedKalmanFilter,
    Sample,
    SquareRoot,
    VehicleProcess,
    samples,
    state_scale,
)
from jaxsub.navigation.attitude import Gyro, PaperAttitude, RotationAttitude
from jaxsub.navigation.position import Course, DeadReckoning
from jaxsub.navigation.strapdown import Inertial, StrapdownNavigation
from jaxsub.recording import Recording
from jaxsub.recording.runs import stack_runs
from jaxsub.simulation import prbs, synthetic
from jaxsub.vehicle.catalogue import dsrv

from .realtime import Flight, flight

_DEGREE = np.pi / 180.0
_RATE = 25
# each program runs once
_QUICKLY: dict[str, str | bool] = {"xla_backend_optimization_level": "0"}
_LEVEL = np.array([1.0, 0.0, 0.0, 0.0])
_FORMS: dict[str, AbstractForm] = {"qr": SquareRoot(), "svd": SquareRoot("svd"), "covariance": Covariance()}
_RULES: dict[str, Callable[[np.ndarray], AbstractNoiseRule]] = {
    "constant": lambda density: ConstantNoise(jnp.diag(density)),
    "fuzzy": lambda density: FuzzyNoise(jnp.asarray(density), jnp.asarray(30.0 * density)),
    "consistent": lambda density: ConsistentFuzzyNoise(jnp.asarray(density)),
}


class Case(NamedTuple):
    """What is filtered: K samples, and the numbers of a filter of them. Standard deviations, and densities' roots."""

    kind: Callable[..., AbstractFilter]
    process: AbstractProcess
    samples: Sample
    x: np.ndarray
    theta: np.ndarray
    first: np.ndarray
    density: np.ndarray
    sigma: np.ndarray


class Track(NamedTuple):
    """(K,) of them: states, parameters, their standard deviations, and the least eigenvalue of the scaled P."""

    x: np.ndarray
    theta: np.ndarray
    std: np.ndarray
    least: np.ndarray


def _sample(inputs: object, outputs: np.ndarray, mask: np.ndarray) -> Sample:
    elapsed = np.full(len(outputs), 1.0 / _RATE)
    elapsed[0] = 0.0
    whole = jax.tree.map(jnp.asarray, (inputs, elapsed, np.where(mask, outputs, 0.0), mask))
    return Sample(*whole)


def _cases(seconds: float) -> dict[str, Case]:
    rng = np.random.default_rng(32)
    run = flight(seconds, rng)
    return {
        "EKF, vehicle": _vehicle(ExtendedKalmanFilter),
        "MEKF, vehicle": _vehicle(ModifiedKalmanFilter),
        "PaperAttitude": _attitude(PaperAttitude(), run, rng),
        "RotationAttitude": _attitude(RotationAttitude(), run, rng),
        "DeadReckoning": _position(run, rng),
        "StrapdownNavigation": _strapdown(run),
    }


def _vehicle(kind: Callable[..., AbstractFilter]) -> Case:
    """A submersible with unknown coefficients, each taken 20 % of itself from where it is."""
    vehicle = dsrv()
    layout, times = vehicle.layout, 0.25 * np.arange(400)
    columns = {name: np.full(times.size, np.nan) for name in layout.channels}
    columns |= {name: 0.1 * np.sin(0.4 * times + i) for i, name in enumerate(layout.interpolated)}
    columns |= {name: prbs(times.size, 15, 0.1, i) for i, name in enumerate(layout.held)}
    recorded = synthetic(vehicle, [Recording("run", times, columns, "run")], seed=7)
    runs = stack_runs(
        recorded, held=layout.held, interpolated=layout.interpolated, channels=layout.channels, substeps=1
    )
    process = VehicleProcess.of(vehicle)
    whole = jax.tree.map(lambda leaf: leaf[0], samples(runs))
    sigma = np.nanstd(np.diff(np.stack([recorded[0].column(name) for name in layout.channels]), n=4), axis=1)
    sigma = sigma / np.sqrt(70.0)  # of white noise's fourth differences
    scale = np.asarray(state_scale(vehicle, jnp.asarray(sigma)))
    theta = np.asarray(process.coordinates()) + 0.2
    zeros = np.zeros(scale.size)
    first = np.concatenate([scale, np.full(theta.size, 0.5)])
    return Case(kind, process, whole, zeros, theta, first, 0.25 * scale, sigma)


def _attitude(process: AbstractProcess, run: Flight, rng: np.random.Generator) -> Case:
    """Gyros, and every second angles to two degrees."""
    ways = 6 if isinstance(process, RotationAttitude) else 7
    measured = run.angles + 2.0 * _DEGREE * rng.normal(size=run.angles.shape)
    mask = np.repeat(np.arange(len(measured))[:, None] % _RATE == 0, 3, axis=1)
    first = np.concatenate([np.full(ways - 3, 5.0), np.ones(3)]) * _DEGREE
    density = np.concatenate([np.full(ways - 3, 0.1), np.full(3, 0.01)]) * _DEGREE
    seen = _sample(Gyro(jnp.asarray(run.gyro)), measured, mask)
    x = np.concatenate([_LEVEL, np.zeros(3)])
    return Case(ExtendedKalmanFilter, process, seen, x, np.zeros(0), first, density, np.full(3, 2.0 * _DEGREE))


def _position(run: Flight, rng: np.random.Generator) -> Case:
    """Speed and attitude, and a fix a second."""
    mask = np.repeat(np.arange(len(run.times))[:, None] % _RATE == 0, 3, axis=1)
    level = run.angles * [0.0, 0.0, 1.0]
    q = Rotation.from_euler("ZYX", level[:, ::-1]).as_quat(scalar_first=True)
    speed = 20.0 + 0.5 * rng.normal(size=len(q))
    course = Course(*map(jnp.asarray, (speed, q, np.full((len(q), 3), 1.0 * _DEGREE))))
    seen = _sample(course, run.fixes, mask)
    zeros = np.zeros(3)
    return Case(ExtendedKalmanFilter, DeadReckoning(), seen, zeros, np.zeros(0), zeros + 5.0, zeros + 0.1, zeros + 0.1)


def _strapdown(run: Flight) -> Case:
    """Gyros, accelerometers and the field's heading, and a fix a second."""
    turned = Rotation.from_euler("ZYX", run.angles[:, ::-1])
    field = turned.inv().apply([0.4, 0.0, 0.9])
    outputs = np.concatenate([run.fixes, np.zeros((len(field), 4))], axis=1)
    fixed = np.arange(len(field)) % _RATE == 0
    mask = fixed[:, None] & (np.arange(7) < 3) | (np.arange(7) == 6)
    inertial = Inertial(*map(jnp.asarray, (run.gyro, run.accelerometer, field)))
    x = np.concatenate([_LEVEL, [20.0, 0.0, 0.0], np.zeros(9)])
    each = lambda *numbers: np.repeat(numbers, 3)
    first = each(10.0 * _DEGREE, 1.0, 1.0, 1.0 * _DEGREE, 0.1)
    density = each(1e-3 * _DEGREE, 1e-4, 1e-4, 0.01 * _DEGREE, 1e-3)
    sigma = np.array([0.1, 0.1, 0.1, 1.0, 1.0, 1.0, 3.0 * _DEGREE])
    seen = _sample(inertial, outputs, mask)
    return Case(ExtendedKalmanFilter, StrapdownNavigation(), seen, x, np.zeros(0), first, density, sigma)


def _in(kind: DTypeLike, tree: Any) -> Any:
    """All its numbers that are not whole in this precision."""
    cast = lambda leaf: leaf.astype(kind) if jnp.issubdtype(jnp.asarray(leaf).dtype, jnp.floating) else leaf
    return jax.tree.map(lambda leaf: cast(leaf) if isinstance(leaf, jax.Array | np.ndarray) else leaf, tree)


def _followed(case: Case, rule: str, form: AbstractForm, kind: DTypeLike) -> Track:
    with jax.enable_x64(kind is np.float64):
        s = case.density.size
        roots = jnp.diag(case.sigma), jnp.diag(case.first[:s])
        filter = _in(kind, case.kind(case.process, _RULES[rule](case.density), *roots, form))
        seen, x, theta, theta_root = _in(kind, (case.samples, case.x, case.theta, np.diag(case.first[s:])))

        def step(state, sample):
            state, found = filter.step(state, sample)
            return state, (found.x, found.theta, found.x_std, found.theta_std, state.joint)

        given = jax.tree.map(jnp.asarray, (seen, x, theta, theta_root))
        follow = lambda seen, *start: jax.lax.scan(step, filter.start(*start), seen)[1]
        found = jax.jit(follow).lower(*given).compile(_QUICKLY)(*given)
        x, theta, x_std, theta_std, kept = (np.asarray(part, float) for part in found)
    return Track(x, theta, np.concatenate([x_std, theta_std], axis=1), _least(kept, isinstance(form, SquareRoot)))


def _least(kept: np.ndarray, root: bool) -> np.ndarray:
    """Of P scaled to a correlation; minus infinity where it is no matrix of numbers."""
    sound = np.asarray(np.isfinite(kept).all(axis=(1, 2)))
    kept = np.where(sound[:, None, None], kept, 0.0)
    size = np.linalg.norm(kept, axis=2) if root else np.sqrt(np.abs(np.diagonal(kept, axis1=1, axis2=2)))
    size = np.where(size > 0.0, size, 1.0)
    if root:
        least = np.linalg.svd(kept / size[:, :, None], compute_uv=False)[:, -1] ** 2
    else:
        scaled = kept / (size[:, :, None] * size[:, None, :])
        least = np.linalg.eigvalsh((scaled + scaled.swapaxes(1, 2)) / 2.0)[:, 0]
    return np.where(sound, least, -np.inf)


def _compared(case: Case, low: Track, high: Track) -> dict[str, float | bool]:
    """By how much they differ, in standard deviations as they are in 64 bits."""
    apart = jax.vmap(case.process.difference)(jnp.asarray(low.x), jnp.asarray(high.x))
    change = np.concatenate([np.asarray(apart), low.theta - high.theta], axis=1)
    # along a quaternion that is of unit length P may be zero
    std = np.maximum(high.std, 1e-9 * high.std.max(axis=0))
    off, spread = np.abs(change / std), np.abs(low.std / std - 1.0)
    bound = lambda a: float(a.max()) if np.isfinite(a).all() else float("inf")
    return {
        "estimate_in_std": bound(off),
        "relative_std": bound(spread),
        "least_eigenvalue": float(low.least.min()),
        "least_eigenvalue_float64": float(high.least.min()),
        "positive_definite": bool(low.least.min() > 0.0),
        "finite": bool(np.isfinite(low.x).all() and np.isfinite(low.std).all()),
    }


def _draw(path: Path, found: dict[str, dict[str, dict[str, dict]]]) -> None:
    rows = [(name, rule) for name, rules in found.items() for rule in rules]
    figure, axis = plt.subplots(figsize=(9.5, 0.34 * len(rows) + 1.2), layout="constrained")
    markers = {"qr": ("o", "#1f4e79"), "svd": ("s", "#6f9bc4"), "covariance": ("^", "#b5482a")}
    for form, (marker, colour) in markers.items():
        cells = [(i, found[name][rule][form]) for i, (name, rule) in enumerate(rows) if form in found[name][rule]]
        where, size = [i for i, _ in cells], [max(cell["estimate_in_std"], 1e-9) for _, cell in cells]
        axis.plot(np.minimum(size, 1e2), where, marker, color=colour, label=form, ms=6)
        lost = [(min(s, 1e2), i) for s, (i, cell) in zip(size, cells, strict=True) if not cell["positive_definite"]]
        label = "P not positive definite" if form == "covariance" else None
        axis.plot([a for a, _ in lost], [b for _, b in lost], "o", mfc="none", mec="k", ms=12, label=label)
    axis.set(
        xscale="log", xlabel="largest difference of 32 from 64 bits, standard deviations", ylim=(len(rows) - 0.5, -0.5)
    )
    axis.set_yticks(range(len(rows)), [f"{name}, {rule}" for name, rule in rows])
    axis.grid(alpha=0.3)
    axis.legend(frameon=False, fontsize=9)
    figure.savefig(path, dpi=120)
    plt.close(figure)


def run(out: Path, quick: bool) -> dict:
    """Every filter with every rule, and every form with the last of them; the numbers.

    In 64 bits the forms are one to rounding, so that one program a filter and rule is what all are compared with.
    """
    rules = ("consistent",) if quick else tuple(_RULES)
    found: dict[str, dict[str, dict[str, dict]]] = {}
    for name, case in _cases(20.0 if quick else 120.0).items():
        # the vehicle's programs take the longest to compile
        if quick and name == "EKF, vehicle":
            continue
        found[name] = {}
        for rule in rules:
            high = _followed(case, rule, SquareRoot(), np.float64)
            forms = {label: form for label, form in _FORMS.items() if label == "qr" or rule == rules[-1]}
            found[name][rule] = {
                label: _compared(case, _followed(case, rule, form, np.float32), high) for label, form in forms.items()
            }
    _draw(out / "precision.png", found)
    roots = [row[form] for rows in found.values() for row in rows.values() for form in row if form != "covariance"]
    return {
        "filters": found,
        "worst_square_root_in_std": max(cell["estimate_in_std"] for cell in roots),
        "square_roots_positive_definite": all(cell["positive_definite"] for cell in roots),
    }
