"""BROAD: orientation of a hand-held sensor board against an optical reference, beside published and installed filters.

The settings are round numbers of physics, but not chosen blindly: that a scale error is modelled, and axis by axis,
was decided on the errors of trials 02, 06, 21 and 26 with some forty settings, so that only other trials judge them.
The board stays within reach of a hand, which is all that keeps the velocity: its position is zero to half a metre, and
lasts less than a second. Sensors have the noise of their class and a scale error of 0.5 % (over motions of half a
second, hence √s). The magnetometer's delay is found from the gyros alone, for a field that stands still turns at minus
the body's rate. Errors that last for a time τ and are sampled every T are given to the filter as white noise of √(2τ/T)
times their size.
"""

import json
import math
import multiprocessing
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
from scipy.signal import savgol_filter
from scipy.spatial.transform import Rotation

from jaxsub.filter import (
    AbstractNoiseRule,
    ConstantNoise,
    ExtendedKalmanFilter,
    FilterState,
    FuzzyNoise,
    InnovationNoise,
    SageHusaNoise,
    Sample,
)
from jaxsub.navigation.alignment import MagneticField, aligned
from jaxsub.navigation.strapdown import Inertial, SensorNoise, StrapdownNavigation

from ..data import data_folder
from .recordings_figure import draw_broad
from .recordings_peers import Readings, peers

INTERVAL = 7.0 / 2000.0  # s between samples
_BEHIND = 3  # samples by which the magnetometer is behind the gyros
_EVERY = 10  # samples from one correction to the next, 35 ms
_STILL = 1.0  # s at the start in which the board lies still: every trial begins with half a minute of it
_NED_TO_ENU = Rotation.from_matrix([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
# the rules' limits for attitude, velocity, position and the biases, per root second
_MOST = np.repeat([math.radians(1.0), 0.3, 0.1, 1e-3, 1e-2], 3)


class Settings(NamedTuple):
    """What the filter assumes, SI; the sensitivity table halves and doubles each."""

    white: jax.Array | float = 1.0  # of the default, 0.01 °/s/√Hz and 0.01 m/s²/√Hz
    scale_error: jax.Array | float = 0.005  # √s
    reach: jax.Array | float = 0.5  # m
    reach_time: jax.Array | float = 1.0  # s
    field_spread: jax.Array | float = 0.03  # of the field, between places in a room
    field_time: jax.Array | float = 1.0  # s from one place to another
    magnetic_delay: jax.Array | float = _BEHIND * INTERVAL  # s
    wander: jax.Array | float = 1.0  # of the biases: 2 °/h and 10⁻⁵ g a root second


# the two times enter with the root of them, beside a size
_VARIED = [name for name in Settings._fields if not name.endswith("_time")]


class Trial(NamedTuple):
    """A trial: (K, 3) rad/s, m/s², µT; the reference, NaN where it dropped out, and where errors count."""

    name: str
    times: np.ndarray
    gyro: np.ndarray
    accelerometer: np.ndarray
    magnetometer: np.ndarray
    reference: np.ndarray
    counts: np.ndarray


def trials() -> list[Trial]:
    """Those in the data folder."""
    return [_trial(file) for file in sorted(data_folder("broad").glob("[0-9][0-9]_*.parquet"))]


def _trial(file: Path) -> Trial:
    rows = pd.read_parquet(file)
    part = lambda start: rows[[c for c in rows if c.startswith(start)]].to_numpy(float)
    reference = part("ref_q")
    counts = rows["movement"].to_numpy(bool) & np.isfinite(reference).all(axis=1)
    return Trial(file.stem, rows["t_s"].to_numpy(), part("gyr"), part("acc"), part("mag"), reference, counts)


def rmse(trial: Trial, q: np.ndarray) -> dict[str, float]:
    """The data set's own errors of `q`, body to ENU, in degrees: total, heading and inclination."""
    found = Rotation.from_quat(q[trial.counts], scalar_first=True)
    error = found * Rotation.from_quat(trial.reference[trial.counts], scalar_first=True).inv()
    w, _, _, z = error.as_quat(canonical=True, scalar_first=True).T
    angles = {
        "total": 2.0 * np.arccos(np.clip(w, 0.0, 1.0)),
        "heading": 2.0 * np.arctan2(np.abs(z), w),
        "inclination": 2.0 * np.arccos(np.clip(np.hypot(w, z), 0.0, 1.0)),
    }
    return {name: float(np.degrees(np.sqrt(np.mean(angle**2)))) for name, angle in angles.items()}


def gyros_delay(trial: Trial) -> float:
    """s by which the field m is behind the gyros: the least Σ|ṁ + ω × m|² over whole samples, and between."""
    smooth = lambda values, order: np.asarray(savgol_filter(values, 21, 2, deriv=order, delta=INTERVAL, axis=0))
    still = trial.times < trial.times[0] + _STILL
    rate = smooth(trial.gyro - trial.gyro[still].mean(axis=0), 0)
    slope, field = smooth(trial.magnetometer, 1), smooth(trial.magnetometer, 0)
    lags = np.arange(-3, 13)
    loss = np.array([np.mean((slope + np.cross(np.roll(rate, lag, axis=0), field)) ** 2) for lag in lags])
    best = int(np.clip(np.argmin(loss), 1, len(lags) - 2))
    left, middle, right = loss[best - 1 : best + 2]
    return float(INTERVAL * (lags[best] + 0.5 * (left - right) / (left - 2.0 * middle + right)))


def without_delay(trial: Trial) -> np.ndarray:
    return np.roll(trial.magnetometer, -_BEHIND, axis=0)


def field_heading(trial: Trial) -> dict[str, float]:
    """Heading of the magnetometer's field in the reference, degrees east of its north: what no filter can know."""
    seen = without_delay(trial)[trial.counts]
    east, north, _ = Rotation.from_quat(trial.reference[trial.counts], scalar_first=True).apply(seen).T
    heading = np.degrees(np.unwrap(np.arctan2(east, north)))
    return {"mean": float(heading.mean()), "std": float(heading.std())}


class Prepared(NamedTuple):
    """A trial for the filter, padded; with leading axes many."""

    samples: Sample
    start: jax.Array
    horizontal: jax.Array
    down: jax.Array


def prepared(trial: Trial, length: int) -> Prepared:
    """Attitude, field and gyro bias from the first second's means."""
    still = trial.times < trial.times[0] + _STILL
    gyro, accelerometer, field = (part[still].mean(axis=0) for part in trial[2:5])
    found = aligned(jnp.asarray(accelerometer), jnp.asarray(field))
    start = jnp.concatenate([found.q, jnp.zeros(6), jnp.asarray(gyro), jnp.zeros(3)])
    K = len(trial.times)
    padded = lambda values: jnp.concatenate([values, np.zeros((length - K, *values.shape[1:]), values.dtype)])
    mask = np.zeros((K, 7), bool)
    mask[::_EVERY, [0, 1, 2, 6]] = True
    elapsed = np.diff(trial.times, prepend=trial.times[0])
    inertial = Inertial(*(padded(part) for part in trial[2:5]))
    samples = Sample(inertial, padded(elapsed), jnp.zeros((length, 7)), padded(mask))
    return Prepared(samples, start, found.field[0], found.field[2])


def _rules() -> dict[str, Callable[[jax.Array], AbstractNoiseRule]]:
    most = jnp.asarray(_MOST)
    return {
        "constant": lambda least: ConstantNoise(jnp.diag(least)),
        "fuzzy": lambda least: FuzzyNoise(least, most),
        "sage_husa": lambda least: SageHusaNoise(least, least, most),
        "innovation": lambda least: InnovationNoise(least, channels=7),
    }


def follow(rule: str, settings: Settings, trial: Prepared) -> tuple[jax.Array, jax.Array]:
    """(K, 4) attitudes, body to NED, and whether the filter broke down."""
    wander = settings.wander * jnp.repeat(jnp.array([0.0, 1e-5, 1e-4]), jnp.array([9, 3, 3]), total_repeat_length=15)
    plain = SensorNoise()
    white = {name: settings.white * getattr(plain, name) for name in ("gyro", "accelerometer")}
    share = {f"{name}_share": settings.scale_error for name in white}
    sensors = SensorNoise(**white, **share, magnetic_delay=settings.magnetic_delay)
    strength = jnp.hypot(trial.horizontal, trial.down)
    process = StrapdownNavigation(
        sensors, MagneticField(trial.horizontal, trial.down, settings.field_spread * strength)
    )
    interval = _EVERY * INTERVAL
    place = settings.reach * jnp.sqrt(2.0 * settings.reach_time / interval)
    heading = jnp.sqrt(2.0 * settings.field_time / interval)
    # nothing measures the velocity
    R_root = jnp.diag(jnp.stack([place] * 3 + [jnp.ones(())] * 3 + [heading]))
    deviations = jnp.repeat(jnp.array([0.02, 0.1, 0.1, math.radians(0.05), 0.05]), 3).at[2].set(0.05)
    filter = ExtendedKalmanFilter(process, _rules()[rule](wander), R_root, jnp.diag(deviations))
    state = filter.start(trial.start, jnp.zeros(0), jnp.zeros((0, 0)))

    def step(state: FilterState, sample: Sample) -> tuple[FilterState, jax.Array]:
        state, estimate = filter.step(state, sample)
        return state, estimate.x[:4]

    state, q = jax.lax.scan(step, state, trial.samples)
    return q, state.diverged


@eqx.filter_jit
def _follow_all(rule: str, settings: Settings, batch: Prepared) -> tuple[jax.Array, jax.Array]:
    """(settings, trials, K, 4) attitudes and (settings, trials) whether the filter broke down."""
    each = jax.vmap(lambda settings, trial: follow(rule, settings, trial), in_axes=(None, 0))
    return jax.vmap(each, in_axes=(0, None))(settings, batch)


def _scores(recorded: list[Trial], rule: str, settings: list[Settings], batch: Prepared) -> list[dict]:
    """Errors by trial for each of the settings."""
    stacked = Settings(*(jnp.array(column) for column in zip(*settings, strict=True)))
    q, diverged = map(np.asarray, _follow_all(rule, stacked, batch))
    return [
        {
            trial.name: rmse(trial, to_enu(part[: len(trial.times)])) | {"diverged": bool(broken)}
            for trial, part, broken in zip(recorded, of_settings, broke, strict=True)
        }
        for of_settings, broke in zip(q, diverged, strict=True)
    ]


def to_enu(q: np.ndarray) -> np.ndarray:
    return (_NED_TO_ENU * Rotation.from_quat(q, scalar_first=True)).as_quat(scalar_first=True)


def peer_scores(trial: Trial, dip: float, quick: bool) -> dict[str, dict[str, float]]:
    """Errors of installed filters; VQF also with the magnetometer's delay taken off, as ours has it."""
    readings = Readings(trial.gyro, trial.accelerometer, trial.magnetometer, INTERVAL, dip)
    found = dict(peers(readings, ("vqf",) if quick else ("vqf", "ahrs")))
    timely = peers(readings._replace(magnetometer=without_delay(trial)), ("vqf",))
    found |= {f"{name}_without_delay": q for name, q in timely}
    return {name: rmse(trial, q) for name, q in found.items()}


def _sensitivity(recorded: list[Trial], batch: Prepared) -> dict[str, dict[str, float]]:
    """Mean total error over the trials with each setting halved and doubled."""
    plain = Settings()
    changed = [plain._replace(**{name: factor * getattr(plain, name)}) for name in _VARIED for factor in (0.5, 2.0)]
    means = [_mean(scores)["total"] for scores in _scores(recorded, "constant", changed, batch)]
    pairs = zip(means[::2], means[1::2], strict=True)
    return {name: {"halved": a, "doubled": b} for name, (a, b) in zip(_VARIED, pairs, strict=True)}


def _mean(scores: dict[str, dict]) -> dict[str, float]:
    return {kind: float(np.mean([of[kind] for of in scores.values()])) for kind in ("total", "heading", "inclination")}


def run(out: Path, quick: bool) -> dict:
    """Errors in degrees by method and trial; `quick` leaves out the slow peers and the table of sensitivity."""
    recorded = trials()
    length = max(len(trial.times) for trial in recorded)
    parts = [prepared(trial, length) for trial in recorded]
    batch = jax.tree.map(lambda *leaves: jnp.stack(leaves), *parts)
    dips = np.arctan2(batch.down, batch.horizontal).tolist()
    # the peers loop in Python, a minute for the four trials: beside the filters, in a process of their own
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        waited = pool.map(peer_scores, recorded, dips, [quick] * len(recorded))
        settings = [Settings()] if quick else [Settings(), Settings(scale_error=0.0)]
        ours = {rule: _scores(recorded, rule, settings, batch) for rule in _rules()}
        table = {} if quick else _sensitivity(recorded, batch)
        others = list(waited)
    methods = {rule: of[0] for rule, of in ours.items()}
    published = json.loads((data_folder("broad") / "trials_and_published_rmse.json").read_text(encoding="utf-8"))
    for name in ("madgwick", "mahony"):
        methods[f"published_{name}"] = {trial.name: published[trial.name][name] for trial in recorded}
    methods |= {name: {trial.name: of[name] for trial, of in zip(recorded, others, strict=True)} for name in others[0]}
    draw_broad(out / "broad.png", methods)
    return {
        "settings": Settings()._asdict(),
        "rmse_deg": methods,
        "mean_rmse_deg": {name: _mean(scores) for name, scores in methods.items()},
        "mean_rmse_deg_without_scale_error": {rule: _mean(of[-1]) for rule, of in ours.items() if not quick},
        "peers_not_installed": [package for package in ("vqf", "ahrs") if find_spec(package) is None],
        "sensitivity_mean_total_deg": table,
        "magnetometer_behind_gyros_ms": {trial.name: 1e3 * gyros_delay(trial) for trial in recorded},
        "field_heading_in_reference_deg": {trial.name: field_heading(trial) for trial in recorded},
    }
