"""ANSFL: four inertial units strapped to a quadrotor, GPS once a second, no magnetometer; RTK and autopilot judge.

Every record begins in flight and in a manoeuvre. Roll and pitch start at zero, give or take 0.3 rad, and nobody tells
the heading: six filters start at six headings, and at every moment the one that has made the recording most likely
so far speaks. GPS is the RTK track once a second, with noise and as it is. The noise is the sensors': rotor vibration
of 2 to 5 m/s² and 8 °/s a sample at 120 Hz is at most 0.4 m/s²/√Hz and 0.7 °/s/√Hz, were it white. 0.3 of each is
assumed; 0.1 was tried too, on paths 8, 9, 10 and 15, and so were eight headings.
"""

import math
from functools import partial
from pathlib import Path
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd

from jaxsub.filter import (
    AbstractNoiseRule,
    ConstantNoise,
    Estimate,
    ExtendedKalmanFilter,
    FilterState,
    FuzzyNoise,
    Sample,
)
from jaxsub.navigation.rotation import euler, from_euler
from jaxsub.navigation.strapdown import Inertial, SensorNoise, StrapdownNavigation

from ..data import data_folder
from .ansfl_tracks import Track, constant_velocity, last_two_fixes
from .recordings_figure import Outage, draw_ansfl

# s that the inertial units' clock is ahead of the reference's, by cross-correlation of the rates (PROVENANCE.md)
_CLOCK = {8: 0.40, 9: 0.40, 10: 0.40, 11: 0.40, 13: 0.40, 15: 0.42, 17: -0.36, 24: -0.63}
# °/s about x that autopilot and gyros together show, by unit (PROVENANCE.md)
BIAS = {1: (-1.1, -0.7), 2: (-2.2, -1.8), 3: (-1.9, -1.5), 4: (1.1, 1.5)}
_HEADINGS = 6
SETTLED = 10.0  # s before which errors do not count; the first outage begins five later
OUTAGE = 10.0  # s
_SHOWN = 4  # the record of the figure
GPS_STD = np.array([0.5, 0.5, 1.0])  # m
_RTK_STD = np.array([0.05, 0.05, 0.1])  # m; its height is written to a tenth
_SENSORS = SensorNoise(gyro=math.radians(0.3), accelerometer=0.3)
# of δ, v, p and the biases at the start
_FIRST = np.repeat([0.3, 5.0, 1.0, math.radians(2.0), 0.7], 3)
_LEAST = np.repeat([0.0, 0.0, 0.0, 1e-4, 1e-3], 3)
_MOST = np.repeat([math.radians(2.0), 1.0, 0.1, 1e-2, 1e-1], 3)


class Record(NamedTuple):
    """One unit on one path, in the reference's clock, body axes forward, starboard, down.

    **Fields**

    - `times`: (K,) s; `gyro`, `accelerometer`: (K, 3). `dot`: (K, 2) roll and pitch by the unit's own filter, rad.
    - `reference_times`: (M,) s; `position`: (M, 3) north, east, down, m; `attitude`: (M, 3) roll, pitch, heading, rad.
    """

    path: int
    unit: int
    times: np.ndarray
    gyro: np.ndarray
    accelerometer: np.ndarray
    dot: np.ndarray
    reference_times: np.ndarray
    position: np.ndarray
    attitude: np.ndarray


def records() -> list[Record]:
    """Those in the data folder whose clock is known."""
    folder = data_folder("ansfl_quadrotor_rtk")
    found = []
    for path, ahead in _CLOCK.items():
        for file in sorted(folder.glob(f"path{path:02d}_imu*_120hz.parquet")):
            reference = pd.read_parquet(folder / f"path{path:02d}_reference_10hz.parquet")
            found.append(_record(path, int(file.name[10]), ahead, pd.read_parquet(file), reference))
    return found


def _record(path: int, unit: int, ahead: float, rows: pd.DataFrame, reference: pd.DataFrame) -> Record:
    known = reference["t_s"].to_numpy()
    times = rows["t_s"].to_numpy() - ahead
    # from the first fix on
    inside = (times >= math.ceil(max(times[0], known[0]))) & (times <= known[-1])
    columns = lambda names: rows[names].to_numpy(float)[inside]
    # x forward, y left, z up
    turned = np.array([1.0, -1.0, -1.0])
    gyro = turned * columns([f"gyr_{axis}_rad_s" for axis in "xyz"])
    accelerometer = turned * columns([f"acc_{axis}_m_s2" for axis in "xyz"])
    dot = columns(["dot_euler_x_rad", "dot_euler_y_rad"]) * [1.0, -1.0]
    position = reference[["north_m", "east_m", "down_m"]].to_numpy()
    attitude = reference[["roll_rad", "pitch_rad", "heading_rad"]].to_numpy()
    return Record(path, unit, times[inside], gyro, accelerometer, dot, known, position, attitude)


class Prepared(NamedTuple):
    """A record for the filter, padded; `outages`: samples at which one begins."""

    samples: Sample
    outages: jax.Array


def outage_times(record: Record) -> np.ndarray:
    """s at which the GPS falls silent, right after a fix, for ten seconds each: three in flight."""
    last = math.floor(record.reference_times[-1] - OUTAGE - 0.5)
    return np.round(np.linspace(SETTLED + 5.0, last, 3)) + 0.05


def fixes(record: Record, noise: float) -> tuple[np.ndarray, np.ndarray]:
    """Samples right after each full second and the fixes there, `noise` times GPS's off the RTK track."""
    seconds = np.arange(math.ceil(record.times[0]), math.floor(record.times[-1]) + 1)
    at = np.searchsorted(record.times, seconds)
    off = GPS_STD * np.random.default_rng(record.path).normal(size=(len(at), 3))
    return at, interpolated(record.times[at], record.reference_times, record.position) + noise * off


def interpolated(times: np.ndarray, at: np.ndarray, values: np.ndarray) -> np.ndarray:
    return np.stack([np.interp(times, at, column) for column in values.T], axis=1)


def prepared(record: Record, noise: float, length: int) -> Prepared:
    """Samples of the record with fixes; GPS of its own noise if any."""
    K = len(record.times)
    at, found = fixes(record, noise)
    outputs, mask, scale = np.zeros((length, 7)), np.zeros((length, 7), bool), np.ones((length, 7))
    outputs[at, :3], mask[at, :3] = found, True
    scale[:, :3] = GPS_STD if noise else _RTK_STD
    padded = lambda values: jnp.concatenate([values, np.zeros((length - K, *values.shape[1:]))])
    inertial = Inertial(padded(record.gyro), padded(record.accelerometer), jnp.zeros((length, 3)))
    elapsed = padded(np.diff(record.times, prepend=record.times[0]))
    samples = Sample(inertial, elapsed, *map(jnp.asarray, (outputs, mask, scale)))
    return Prepared(samples, jnp.asarray(np.searchsorted(record.times, outage_times(record))))


class Followed(NamedTuple):
    """What the likeliest filter knew after each sample, and without GPS after each sample of an outage.

    **Fields**

    - `x`: (K, 16); `x_std`: (K, 15). `outage_x`, `outage_std`: (outages, samples of it, 16 and 15).
    """

    x: jax.Array
    x_std: jax.Array
    outage_x: jax.Array
    outage_std: jax.Array
    diverged: jax.Array


def _rule(name: str) -> AbstractNoiseRule:
    least = jnp.asarray(_LEAST)
    return ConstantNoise(jnp.diag(least)) if name == "constant" else FuzzyNoise(least, jnp.asarray(_MOST))


def follow(rule: str, record: Prepared) -> Followed:
    """The bank of headings over a record."""
    first = jnp.asarray(_FIRST).at[2].set(2.0 * math.pi / _HEADINGS / math.sqrt(12.0))
    filter = ExtendedKalmanFilter(StrapdownNavigation(_SENSORS), _rule(rule), jnp.eye(7), jnp.diag(first))

    def start(heading: jax.Array) -> FilterState:
        q = from_euler(jnp.stack([jnp.zeros(()), jnp.zeros(()), heading]))
        at = jnp.concatenate([q, jnp.zeros(3), record.samples.outputs[0, :3], jnp.zeros(6)])
        return filter.start(at, jnp.zeros(0), jnp.zeros((0, 0)))

    def step(carry: tuple, numbered: tuple[jax.Array, Sample]) -> tuple[tuple, tuple[jax.Array, jax.Array]]:
        bank, likelihood, saved = carry
        index, sample = numbered
        bank, estimates = jax.vmap(filter.step, in_axes=(0, None))(bank, sample)
        likelihood += jax.vmap(_log_likelihood)(estimates)
        best = jnp.argmax(likelihood)
        chosen = jax.tree.map(lambda leaf: leaf[best], bank)
        begins = index == record.outages
        keep = lambda new, old: jnp.where(begins.reshape(-1, *[1] * new.ndim), new, old)
        return (bank, likelihood, jax.tree.map(keep, chosen, saved)), (estimates.x[best], estimates.x_std[best])

    bank = jax.vmap(start)(2.0 * jnp.pi * jnp.arange(_HEADINGS) / _HEADINGS)
    saved = jax.tree.map(lambda leaf: jnp.stack([leaf[0]] * len(record.outages)), bank)
    count = len(record.samples.elapsed)
    carry = bank, jnp.zeros(_HEADINGS), saved
    (bank, _, saved), (x, x_std) = jax.lax.scan(step, carry, (jnp.arange(count), record.samples))

    def dark(state: FilterState, begin: jax.Array) -> tuple[jax.Array, jax.Array]:
        cut = partial(jax.lax.dynamic_slice_in_dim, start_index=begin + 1, slice_size=round(OUTAGE * 120.0))
        samples = jax.tree.map(cut, record.samples)
        silent = Sample(samples.inputs, samples.elapsed, samples.outputs, jnp.zeros_like(samples.mask), samples.scale)
        estimates = jax.lax.scan(lambda state, sample: filter.step(state, sample), state, silent)[1]
        return estimates.x, estimates.x_std

    return Followed(x, x_std, *jax.vmap(dark)(saved, record.outages), jnp.any(bank.diverged))


def _log_likelihood(estimate: Estimate) -> jax.Array:
    whitened = jax.scipy.linalg.solve_triangular(estimate.factor, estimate.innovation, lower=True)
    heard = jnp.any(estimate.used)
    diagonal = jnp.sum(jnp.log(jnp.abs(jnp.diag(estimate.factor))))
    found = jnp.where(heard, -0.5 * whitened @ whitened - diagonal, 0.0)
    return jnp.where(estimate.diverged, -jnp.inf, found)


@eqx.filter_jit
def _follow_all(rule: str, batch: Prepared) -> Followed:
    return jax.vmap(partial(follow, rule))(batch)


def rms(errors: np.ndarray) -> float:
    """Of distances, or of numbers."""
    return float(np.sqrt(np.mean(np.sum(errors.reshape(len(errors), -1) ** 2, axis=1))))


def attitude_errors(record: Record, angles: np.ndarray, times: np.ndarray) -> dict[str, float]:
    """Degrees after settling: roll and pitch of (K, 2 or 3) `angles` at `times`, raw and less their mean."""
    judged = record.reference_times >= SETTLED
    judged &= record.reference_times <= times[-1]
    found = interpolated(record.reference_times[judged], times, np.unwrap(angles, axis=0))
    apart = np.degrees(found - record.attitude[judged, : found.shape[1]])
    apart = (apart + 180.0) % 360.0 - 180.0
    scores = {}
    for name, column in zip(("roll", "pitch", "heading"), apart.T, strict=False):
        scores[name] = rms(column)
        scores[f"{name}_less_mean"] = rms(column - column.mean())
    return scores


def _others(times: np.ndarray, measured: np.ndarray, std: np.ndarray) -> dict[str, Track]:
    return {
        "last_two_fixes": last_two_fixes(times, measured),
        "no_inertial_unit": constant_velocity(times, measured, std),
    }


def _scores(record: Record, noise: float, found: Followed) -> dict:
    """Attitude, position between fixes and in outages, and the gyros' bias about x."""
    K = len(record.times)
    x, x_std = np.asarray(found.x)[:K], np.asarray(found.x_std)[:K]
    at, measured = fixes(record, noise)
    others = _others(record.times[at], measured, GPS_STD if noise else _RTK_STD)
    times = record.reference_times[(record.reference_times >= SETTLED) & (record.reference_times <= record.times[-1])]
    truth = lambda times: interpolated(times, record.reference_times, record.position)
    position = {"fused": rms(interpolated(times, record.times, x[:, 7:10]) - truth(times))}
    position |= {name: rms(track.at(times) - truth(times)) for name, track in others.items()}
    outages = []
    for i, begin in enumerate(np.searchsorted(record.times, outage_times(record))):
        # every twelfth sample: ten a second
        span = record.times[begin + 1 : begin + 1 + round(OUTAGE * 120.0)][11::12]
        apart = {"fused": np.asarray(found.outage_x[i])[11::12, 7:10] - truth(span)}
        apart |= {
            name: track.without_fixes(span, float(record.times[begin])) - truth(span) for name, track in others.items()
        }
        outages.append({name: {"rms": rms(e), "final": float(np.linalg.norm(e[-1]))} for name, e in apart.items()})
    low, high = BIAS[record.unit]
    return {
        "attitude_deg": attitude_errors(record, np.asarray(_euler(found.x))[:K], record.times),
        "position_rms_m": position,
        "outages_m": outages,
        "gyro_bias_x_deg_s": {
            "found": float(np.degrees(x[-1, 10])),
            "std": float(np.degrees(x_std[-1, 9])),
            "told": [low, high],
        },
        "diverged": bool(found.diverged),
    }


@jax.jit
def _euler(x: jax.Array) -> jax.Array:
    return jax.vmap(euler)(x[:, :4])


def _drawn(name: str, record: Record, found: Followed) -> Outage:
    """Its second outage, with the five seconds before."""
    at, measured = fixes(record, 1.0)
    begin = int(np.searchsorted(record.times, outage_times(record)[1]))
    since = float(record.times[begin])
    before, dark = slice(begin - 600, begin + 1), slice(begin + 1, begin + 1 + round(OUTAGE * 120.0))
    times = np.concatenate([record.times[before], record.times[dark]])
    joined = lambda whole, outage: np.concatenate([np.asarray(whole)[before], np.asarray(outage)[1]])
    others = {
        name: np.concatenate([track.at(record.times[before]), track.without_fixes(record.times[dark], since)])[:, :2]
        for name, track in _others(record.times[at], measured, GPS_STD).items()
    }
    return Outage(
        f"{name}: GPS of 0.5 m, silent for 10 s",
        record.position[:, :2],
        measured[at <= begin, :2],
        times,
        since,
        interpolated(times, record.reference_times, record.position)[:, :2],
        joined(found.x, found.outage_x)[:, 7:9],
        joined(found.x_std, found.outage_std)[:, 6:8],
        others,
    )


def _summary(scores: dict[str, dict]) -> dict:
    """Means of attitude errors, and roots of mean squares of distances, over the records."""
    of = list(scores.values())
    root = lambda values: float(np.sqrt(np.mean(np.square(values))))
    methods = of[0]["position_rms_m"]
    outages = [outage for record in of for outage in record["outages_m"]]
    biases = {name: round(record["gyro_bias_x_deg_s"]["found"], 2) for name, record in scores.items()}
    return {
        "attitude_deg": {a: float(np.mean([r["attitude_deg"][a] for r in of])) for a in of[0]["attitude_deg"]},
        "position_rms_m": {m: root([r["position_rms_m"][m] for r in of]) for m in methods},
        "outage_rms_m": {m: root([o[m]["rms"] for o in outages]) for m in methods},
        "outage_final_m": {m: root([o[m]["final"] for o in outages]) for m in methods},
        "outage_final_median_m": {m: float(np.median([o[m]["final"] for o in outages])) for m in methods},
        "gyro_bias_x_deg_s": {
            f"unit {unit}": {"found": [b for n, b in biases.items() if n.endswith(f"unit {unit}")], "told": stated}
            for unit, stated in BIAS.items()
        },
        "diverged": sum(r["diverged"] for r in of),
    }


def run(out: Path, quick: bool) -> dict:
    """All records in one batch, for each rule and GPS; `quick` takes the constant rule and GPS alone."""
    recorded = records()
    length = max(len(record.times) for record in recorded)
    results: dict = {}
    cases = [("constant", "gps"), ("constant", "rtk"), ("fuzzy", "gps")]
    for rule, gps in cases[:1] if quick else cases:
        noise = 1.0 if gps == "gps" else 0.0
        parts = [prepared(record, noise, length) for record in recorded]
        batch = jax.tree.map(lambda *leaves: jnp.stack(leaves), *parts)
        found = _follow_all(rule, batch)
        each = [jax.tree.map(lambda leaf, i=i: leaf[i], found) for i in range(len(recorded))]
        names = [f"path {record.path}, unit {record.unit}" for record in recorded]
        scores = {n: _scores(r, noise, f) for n, r, f in zip(names, recorded, each, strict=True)}
        results[f"{rule}, {gps}"] = {"summary": _summary(scores), "records": scores}
        if (rule, gps) == ("constant", "gps"):
            draw_ansfl(out / "ansfl.png", _drawn(names[_SHOWN], recorded[_SHOWN], each[_SHOWN]))
    units = {f"path {r.path}, unit {r.unit}": attitude_errors(r, r.dot, r.times) for r in recorded}
    means = {a: float(np.mean([of[a] for of in units.values()])) for a in next(iter(units.values()))}
    return {"filters": results, "units_own_filter_deg": {"mean": means, "records": units}}
