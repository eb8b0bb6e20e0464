"""Steps a second of one attitude filter, batched: this library's, filterpy's and dynamax's, on the same numbers.

The model is the paper's quaternion and gyro bias (7 states) measured by roll, pitch and yaw (3), with nothing that one
of the three could not do: a correction is added, and no angle comes near a turn.
"""

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from dynamax.nonlinear_gaussian_ssm import ParamsNLGSSM, extended_kalman_filter  # pyright: ignore[reportMissingImports]
from filterpy.kalman import ExtendedKalmanFilter as Filterpy  # pyright: ignore[reportMissingImports]
from jax.experimental.compilation_cache import compilation_cache
from jax.typing import DTypeLike

from jaxsub.filter import (
    AbstractForm,
    AbstractProcess,
    ConstantNoise,
    Covariance,
    ExtendedKalmanFilter,
    FilterState,
    Sample,
    SquareRoot,
)
from jaxsub.navigation.attitude import Gyro
from jaxsub.navigation.rotation import euler, normalised, omega_matrix

_STEP = 0.05
_SAMPLES = 50
_SIGMA = np.full(3, 0.02)
_START = np.array([0.1, 0.1, 0.1, 0.1, 0.01, 0.01, 0.01])
_DENSITY = np.array([0.01, 0.01, 0.01, 0.01, 1e-3, 1e-3, 1e-3])
_FIRST = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
_COLOURS = {"dynamax": "#b5482a", "square root": "#1f4e79", "covariance": "#6f9bc4"}


class Attitude(AbstractProcess):
    """The attitude as a vector of seven numbers."""

    def step(self, x: jax.Array, theta: jax.Array, sample: Sample) -> jax.Array:
        return _moved(x, sample.inputs.rate, sample.elapsed)

    def observe(self, x: jax.Array, theta: jax.Array, sample: Sample) -> jax.Array:
        return euler(x[:4])


def _moved(x: jax.Array, rate: jax.Array, elapsed: jax.Array | float) -> jax.Array:
    q = x[:4] + 0.5 * elapsed * (omega_matrix(rate - x[4:]) @ x[:4])
    return jnp.concatenate([normalised(q), x[4:]])


class Data(NamedTuple):
    """(B, K, 3) gyros, rad/s, and angles, rad; no time passes before the first sample."""

    rates: np.ndarray
    angles: np.ndarray


def _data(batch: int, rng: np.random.Generator) -> Data:
    """A body that sways by some degrees, with noise and bias."""
    t = _STEP * np.arange(_SAMPLES)
    phase, size = rng.uniform(0.0, 6.0, (batch, 1, 3)), rng.uniform(0.05, 0.2, (batch, 1, 3))
    angles = size * np.sin(2.0 * t[:, None] + phase) + rng.normal(0.0, _SIGMA, (batch, _SAMPLES, 3))
    rates = 2.0 * size * np.cos(2.0 * t[:, None] + phase) + rng.normal(0.01, 0.01, (batch, _SAMPLES, 3))
    return Data(rates, angles)


def _ours(form: AbstractForm, kind: DTypeLike, whole: bool = False) -> Callable[[jax.Array, jax.Array], tuple]:
    """States and covariances after each sample, (B, K, 7) and (B, K, 7, 7); and the `whole` estimate if requested."""
    cast = lambda a: jnp.asarray(a, kind)
    noise = ConstantNoise(jnp.diag(cast(_DENSITY)))
    filter = ExtendedKalmanFilter(Attitude(), noise, jnp.diag(cast(_SIGMA)), jnp.diag(cast(_START)), form)

    def one(rates: jax.Array, angles: jax.Array) -> tuple:
        elapsed = jnp.full(_SAMPLES, _STEP, kind).at[0].set(0.0)
        samples = Sample(Gyro(rates), elapsed, angles, jnp.ones(angles.shape, bool))
        start = filter.start(cast(_FIRST), jnp.zeros(0, kind), jnp.zeros((0, 0), kind))

        def step(state: FilterState, sample: Sample) -> tuple[FilterState, tuple]:
            state, estimate = filter.step(state, sample)
            found = estimate.x, filter.form.covariance(state.joint)
            return state, (*found, estimate) if whole else found

        return jax.lax.scan(step, start, samples)[1]

    return jax.vmap(one)


def _dynamax(kind: DTypeLike, whole: bool = False) -> Callable[[jax.Array, jax.Array], tuple]:
    """The same; `whole` is the posterior that a call gives without options, with likelihood and predictions."""
    cast = lambda a: jnp.asarray(a, kind)
    params = ParamsNLGSSM(
        initial_mean=cast(_FIRST),
        initial_covariance=jnp.diag(cast(_START) ** 2),
        dynamics_function=lambda x, u: _moved(x, u, _STEP),
        dynamics_covariance=jnp.diag(cast(_DENSITY) ** 2 * _STEP),
        emission_function=lambda x, u: euler(x[:4]),
        emission_covariance=jnp.diag(cast(_SIGMA) ** 2),
    )

    def one(rates: jax.Array, angles: jax.Array) -> tuple:
        found: Any = extended_kalman_filter(params, angles, rates)
        bare = found.filtered_means, found.filtered_covariances
        # what is not requested is not computed either
        return (*bare, found) if whole else bare

    return jax.vmap(one)


class _OneFilterpy(Filterpy):
    """filterpy's filter with this model's step, by hand in NumPy as its users write it."""

    rate: np.ndarray

    def predict_x(self, u: Any = 0) -> None:
        q, bias = self.x[:4], self.x[4:]
        turn = np.eye(4) + 0.5 * _STEP * _omega(self.rate - bias)
        moved = turn @ q
        length = np.linalg.norm(moved)
        unit = moved / length
        scaled = (np.eye(4) - np.outer(unit, unit)) / length
        w, x, y, z = q
        by_bias = 0.5 * _STEP * np.array([[x, y, z], [-w, z, -y], [-z, -w, x], [y, -x, -w]])
        self.F[:4, :4], self.F[:4, 4:] = scaled @ turn, scaled @ by_bias
        self.x = np.concatenate([unit, bias])


def _omega(w: np.ndarray) -> np.ndarray:
    a, b, c = w
    return np.array([[0.0, -a, -b, -c], [a, 0.0, c, -b], [b, -c, 0.0, a], [c, b, -a, 0.0]])


def _angles(state: np.ndarray) -> np.ndarray:
    w, x, y, z = state[:4] / np.linalg.norm(state[:4])
    roll = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return np.array([roll, np.arcsin(2 * (w * y - x * z)), yaw])


def _angles_by_state(state: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(state[:4])
    unit = state[:4] / length
    w, x, y, z = unit
    sine, cosine = 2 * (w * x + y * z), w * w - x * x - y * y + z * z
    roll = (cosine * np.array([x, w, z, y]) - sine * np.array([w, -x, -y, z])) * 2.0 / (sine**2 + cosine**2)
    pitch = 2.0 * np.array([y, -z, w, -x]) / np.sqrt(1.0 - (2 * (w * y - x * z)) ** 2)
    sine, cosine = 2 * (w * z + x * y), w * w + x * x - y * y - z * z
    yaw = (cosine * np.array([z, y, x, w]) - sine * np.array([w, x, -y, -z])) * 2.0 / (sine**2 + cosine**2)
    rows = np.stack([roll, pitch, yaw]) @ (np.eye(4) - np.outer(unit, unit)) / length
    return np.concatenate([rows, np.zeros((3, 3))], axis=1)


def _filterpy(data: Data) -> tuple[np.ndarray, np.ndarray]:
    """The same of each of the batch, one after the other."""
    states, covariances = [], []
    for rates, angles in zip(*data, strict=True):
        one = _OneFilterpy(dim_x=7, dim_z=3)
        one.x, one.P, one.F = _FIRST.copy(), np.diag(_START**2), np.eye(7)
        one.Q, one.R = np.diag(_DENSITY**2 * _STEP), np.diag(_SIGMA**2)
        track, spread = [], []
        for k, (rate, measured) in enumerate(zip(rates, angles, strict=True)):
            one.rate = rate
            if k:
                one.predict()
            one.update(measured, _angles_by_state, _angles)
            track.append(one.x)
            spread.append(one.P)
        states.append(np.stack(track))
        covariances.append(np.stack(spread))
    return np.stack(states), np.stack(covariances)


def _rate(call: Callable[[], Any], batch: int, repeats: int) -> list[float]:
    """Steps a second, of each repeat."""
    found = []
    for _ in range(repeats):
        begin = time.perf_counter()
        jax.block_until_ready(call())
        found.append(batch * _SAMPLES / (time.perf_counter() - begin))
    return found


def _spread(rates: list[float]) -> dict[str, float]:
    return {"median": float(np.median(rates)), "least": float(np.min(rates)), "most": float(np.max(rates))}


def _keep_programs(keep: bool) -> None:
    jax.config.update("jax_enable_compilation_cache", keep)
    compilation_cache.reset_cache()


def _compiled(f: Callable, data: Data, kind: DTypeLike) -> tuple[Callable[[], Any], float]:
    """The program on `data`, and the seconds that it took to compile, with nothing kept from before."""
    given = [jnp.asarray(a, kind) for a in data]
    _keep_programs(False)
    begin = time.perf_counter()
    program = jax.jit(f).lower(*given).compile()
    taken = time.perf_counter() - begin
    _keep_programs(True)
    return lambda: program(*given), taken


def _apart(one: tuple, other: tuple) -> dict[str, float]:
    """The farthest that states are apart in standard deviations, and the deviations relative to themselves."""
    (x, P), (y, S) = [tuple(np.asarray(a, float) for a in pair) for pair in (one[:2], other[:2])]
    mine, std = (np.sqrt(np.diagonal(C, axis1=2, axis2=3)) for C in (P, S))
    return {"state_in_std": float(np.abs((x - y) / std).max()), "relative_std": float(np.abs(mine / std - 1.0).max())}


_MAKERS: dict[str, Callable[[DTypeLike], Callable]] = {
    "square root": lambda kind: _ours(SquareRoot(), kind),
    "covariance": lambda kind: _ours(Covariance(), kind),
    "dynamax": _dynamax,
    "square root, whole": lambda kind: _ours(SquareRoot(), kind, whole=True),
    "dynamax, whole": lambda kind: _dynamax(kind, whole=True),
}


def _timed(kind: DTypeLike, data: Data, repeats: int) -> dict[str, dict[str, float]]:
    batch = len(data.rates)
    programs = {name: _compiled(make(kind), data, kind) for name, make in _MAKERS.items()}
    rates: dict[str, list[float]] = {name: [] for name in programs}
    # in turn, so that what else the machine does meets all of them; the first round warms up
    for repeat in range(repeats + 1):
        for name, (call, _) in programs.items():
            once = _rate(call, batch, 1)
            rates[name] += once if repeat else []
    return {name: {**_spread(rates[name]), "compile_s": taken} for name, (_, taken) in programs.items()}


def _draw(path: Path, found: dict[str, dict], filterpy: float, batches: tuple[int, ...]) -> None:
    figure, axes = plt.subplots(1, 2, figsize=(11.0, 4.4), sharey=True, layout="constrained")
    for axis, bits in zip(axes, ("float64", "float32"), strict=True):
        for name, colour in _COLOURS.items():
            rows = [found[f"{name} {bits} {batch}"] for batch in batches]
            middle, least, most = ([row[key] for row in rows] for key in ("median", "least", "most"))
            axis.fill_between(batches, least, most, color=colour, alpha=0.2, lw=0.0)
            axis.plot(batches, middle, "o-", color=colour, ms=4, label=name)
        axis.axhline(filterpy, color="0.4", ls="--", label="filterpy, one after the other, 64 bits")
        axis.axhline(20.0 * filterpy, color="0.4", ls=":", label="20 times that")
        axis.set(xscale="log", yscale="log", xlabel="filters in the batch", title=bits)
    axes[0].set_ylabel("steps a second")
    axes[1].legend(frameon=False, fontsize=9, loc="center right")
    figure.savefig(path, dpi=120)
    plt.close(figure)


def _best(call: Callable[[], Any], repeats: int = 9) -> float:
    """s of the fastest of so many calls."""
    taken = []
    for _ in range(repeats):
        begin = time.perf_counter()
        call()
        taken.append(time.perf_counter() - begin)
    return min(taken)


def _floor(n: int = 7, c: int = 3) -> dict[str, float]:
    """What a step of the square-root filter must at least take, from this machine's rates in 64 bits.

    Flops: 2n³ for FJ; 4(n - k)(2n - k) for each reflection k of [FJ, G]; 2cn² for CJ; 4(n + c - k)(n + 1) for each of
    the update's; c²n + 2cn for gain and correction. Jacobians are not counted. Bytes: rates and angles in, state and
    covariance out, once each; what is carried stays in the cache. Rates: of a large product of matrices, and of a copy.
    """
    flops = 2 * n**3 + sum(4 * (n - k) * (2 * n - k) for k in range(n)) + 2 * c * n**2
    flops += sum(4 * (n + c - k) * (n + 1) for k in range(c)) + c**2 * n + 2 * c * n
    moved = 8 * (3 + c + n + n**2)
    square, long = np.ones((1000, 1000)), np.ones(10_000_000)
    other = np.empty_like(long)
    flops_per_s = 2.0 * len(square) ** 3 / _best(lambda: square @ square)
    bytes_per_s = 2.0 * long.nbytes / _best(lambda: np.copyto(other, long))
    seconds = {"arithmetic_s": flops / flops_per_s, "memory_s": moved / bytes_per_s}
    rates = {"flops_per_s": flops_per_s, "bytes_per_s": bytes_per_s}
    return {"flops": flops, "bytes": moved, **rates, **seconds, "step_s": max(seconds.values())}


def run(out: Path, quick: bool) -> dict:
    """Compare the three, time them and draw; the numbers."""
    rng = np.random.default_rng(1960)
    batches, repeats = ((1, 256) if quick else (1, 16, 256, 4096)), 3 if quick else 9
    few = _data(2, rng)
    exact = _filterpy(few)
    slow = _spread(_rate(lambda: _filterpy(few), 2, repeats))
    found: dict[str, dict] = {}
    agreement: dict[str, dict] = {}
    for kind in (np.float64, np.float32):
        # dynamax mixes the two where both are to be had
        with jax.enable_x64(kind is np.float64):
            bits = np.dtype(kind).name
            for name, make in _MAKERS.items():
                given = [jnp.asarray(a, kind) for a in few]
                agreement[f"{name} {bits}"] = _apart(jax.jit(make(kind))(*given), exact)
            for batch in batches:
                rows = _timed(kind, _data(batch, rng), repeats)
                found |= {f"{name} {bits} {batch}": row for name, row in rows.items()}
    _draw(out / "throughput.png", found, slow["median"], batches)

    def times(name: str, other: str) -> dict[str, float]:
        ours = {key.removeprefix(name): row["median"] for key, row in found.items() if key.startswith(f"{name} float")}
        return {key.strip(): rate / found[other + key]["median"] for key, rate in ours.items()}

    floor = _floor()
    best = max(row["median"] for key, row in found.items() if key.startswith("square root float64"))
    return {
        "states": 7,
        "measurements": 3,
        "samples": _SAMPLES,
        "agreement_with_filterpy": agreement,
        "filterpy": slow,
        "steps_per_second": found,
        "times_filterpy": best / slow["median"],
        "times_dynamax": {
            "states_and_covariances": times("square root", "dynamax"),
            "all_that_a_call_gives": times("square root, whole", "dynamax, whole"),
            "covariance_form": times("covariance", "dynamax"),
        },
        "floor": {**floor, "share_reached": best * floor["step_s"]},
        "load": os.getloadavg()[0],
    }
