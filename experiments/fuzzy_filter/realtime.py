"""The paper's sensor card in simulation: frames on a line of 9600 bit/s, decoded and filtered one by one, and timed.

At 25 frames a second the line is busy for 61 % of the time. The next frame cannot be complete before 23 bytes have
come, 24 ms; that is the budget of a cycle: decode, construct an attitude, step the filter.
"""

import gc
import os
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import jax.numpy as jnp
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from scipy.spatial.transform import Rotation

from jaxsub.effects import GRAVITY
from jaxsub.filter import AbstractNoiseRule, ConsistentFuzzyNoise, ExtendedKalmanFilter, FuzzyNoise
from jaxsub.navigation import link
from jaxsub.navigation.attitude import Gyro, RotationAttitude
from jaxsub.navigation.compiled_step import Packed, Program, native
from jaxsub.navigation.constructed import ConstructedAttitudeStream
from jaxsub.navigation.stream import Reading, Stream

_DEGREE = np.pi / 180.0
_RATE, _PER_FIX, _SPEED = 25, 25, 20.0
_BUDGET = link.BITS_PER_BYTE * 23 / 9600.0
# a flight step that is to share a processor with everything else
_TARGET = 200e-6
_SETTLED = 40.0
# noise of a gyro sample, an accelerometer's and a fix, and the sensors' nulls
_GYRO, _GYRO_NULL, _ACCELEROMETER, _NULL, _FIX = 0.4 * _DEGREE, 0.5 * _DEGREE, 0.02, 0.02, 0.1
_MEASURED = np.array([2.0, 2.0, 2.0]) * _DEGREE
_FAULTS = {"jitter": 0.01, "corruption": 0.001, "dropout": 0.05}
_PARTS = ("decode", "construct", "filter", "cycle")
_WARM = 100
_UNRESTED = 1000
_NOWHERE = np.zeros(3)
# by JAX's compiler, and by way of C
_COMPILERS: dict[str, Callable[..., Program]] = {"": Program, " in C": native}


class Flight(NamedTuple):
    """(K,) times, (K, 3) angles, rad, and what the sensors show; fixes are those of every sample."""

    times: np.ndarray
    angles: np.ndarray
    gyro: np.ndarray
    accelerometer: np.ndarray
    fixes: np.ndarray


def flight(seconds: float, rng: np.random.Generator) -> Flight:
    """A slow weave along a track that the nose follows."""
    fine = 20
    t = np.arange(int(seconds * _RATE) * fine + 1) / (_RATE * fine)
    roll, pitch = 12.0 * _DEGREE * np.sin(0.11 * t), 8.0 * _DEGREE * np.sin(0.07 * t + 1.0)
    yaw = 40.0 * _DEGREE * np.sin(0.05 * t)
    velocity = _SPEED * np.stack([np.cos(yaw), np.sin(yaw), 0.0 * t], axis=1)
    steps = np.diff(t)[:, None] * (velocity[1:] + velocity[:-1]) / 2.0
    position = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
    force = np.gradient(velocity, t, axis=0) - [0.0, 0.0, GRAVITY]
    turned = Rotation.from_euler("ZYX", np.stack([yaw, pitch, roll], axis=1))
    at = slice(None, None, fine)
    # a gyro frame holds the mean rate since the frame before
    gyro = (turned[:-fine:fine].inv() * turned[fine::fine]).as_rotvec() * _RATE
    gyro = np.concatenate([gyro[:1], gyro])
    shape = gyro.shape
    return Flight(
        t[at],
        np.stack([roll, pitch, yaw], axis=1)[at],
        gyro + _GYRO_NULL * rng.normal(size=3) + _GYRO * rng.normal(size=shape),
        turned[at].inv().apply(force[at]) + _NULL * rng.normal(size=3) + _ACCELEROMETER * rng.normal(size=shape),
        position[at] + _FIX * rng.normal(size=shape),
    )


def arrivals(run: Flight, line: link.Line) -> list[bytes]:
    """What arrives of the frames of a flight, frame by frame."""
    frames = []
    for k, moment in enumerate(run.times):
        fix = run.fixes[k] if k % _PER_FIX == 0 else None
        reading = link.Reading(moment, k, run.gyro[k], run.accelerometer[k], fix)
        frames.append((moment, link.encode(reading)))
    return [data for _, data in line.carry(frames)]


class Programs(NamedTuple):
    """What a loop runs, its states at the start, and how long the filter's compilation took."""

    construct: Program
    filter: Program
    constructing: Packed
    filtering: Packed
    compile_s: float


def programs(rule: AbstractNoiseRule, compiler: Callable[..., Program]) -> Programs:
    """Compiled for a start that is level and without bias."""
    first = np.concatenate([np.full(3, 10.0), np.ones(3)]) * _DEGREE
    filter = ExtendedKalmanFilter(RotationAttitude(), rule, jnp.diag(jnp.asarray(_MEASURED)), jnp.diag(first))
    stream, zeros = Stream(filter), jnp.zeros(3)
    reading = Reading(jnp.zeros(()), Gyro(zeros), zeros, jnp.zeros(3, bool))
    begun = filter.start(jnp.array([1.0, *[0.0] * 6]), jnp.zeros(0), jnp.zeros((0, 0)))
    level = ConstructedAttitudeStream.start()
    like = (jnp.zeros(()), zeros, zeros, jnp.zeros((), bool))
    construct = compiler(lambda state, seen: state.step(*seen), level, like)
    still = stream.start(begun, reading)
    begin = time.perf_counter()
    program = compiler(stream.step, still, reading)
    taken = time.perf_counter() - begin
    return Programs(construct, program, construct.pack(level), program.pack(still), taken)


@dataclass
class Loop:
    """The host's loop; `track` is time and quaternion after each frame, `spent` s in each of `_PARTS`."""

    runs: Programs
    constructing: Packed
    filtering: Packed
    decoder: link.Decoder = field(default_factory=link.Decoder)
    track: list[np.ndarray] = field(default_factory=list)
    spent: list[tuple[float, ...]] = field(default_factory=list)

    def cycle(self, data: bytes) -> None:
        """What is done when bytes have come."""
        now = time.perf_counter
        begin = now()
        readings = self.decoder.feed(data)
        decoded = now() - begin
        constructing = filtering = 0.0
        for reading in readings:
            first = now()
            fix, present = (_NOWHERE, False) if reading.fix is None else (reading.fix, True)
            shown = (reading.time, reading.accelerometer, fix, present, reading.gyro)
            given: Any = tuple(map(np.asarray, shown))
            self.constructing, found = self.runs.construct.step(self.constructing, given[:4])
            second = now()
            seen = Reading(given[0], Gyro(given[4]), found.angles, found.known)
            self.filtering, estimate = self.runs.filter.step(self.filtering, seen)
            third = now()
            constructing, filtering = constructing + second - first, filtering + third - second
            self.track.append(np.concatenate([[reading.time], estimate.x[:4]]))
        self.spent.append((decoded, constructing, filtering, now() - begin))


def _rules() -> dict[str, AbstractNoiseRule]:
    density = jnp.asarray(np.concatenate([np.full(3, _GYRO / np.sqrt(_RATE)), np.full(3, 0.01 * _DEGREE)]))
    return {"fuzzy": FuzzyNoise(density, 30.0 * density), "consistent": ConsistentFuzzyNoise(density)}


def _flown(runs: Programs, sent: list[bytes], pause: float = 0.0) -> Loop:
    """The loop after all that arrived, with a `pause` before each cycle."""
    whole = Loop(runs, runs.constructing, runs.filtering)
    gc.collect()
    gc.disable()
    for k, data in enumerate(sent):
        # a loop that never rests is stopped by the system for 50 ms in each second
        if pause or k % _UNRESTED == 0:
            time.sleep(pause or 0.03)
        whole.cycle(data)
    gc.enable()
    return whole


def _latency(spent: np.ndarray) -> dict[str, dict[str, float]]:
    """µs, of each part."""
    rows = 1e6 * spent[_WARM:]
    points = {"p50": 50.0, "p99": 99.0, "worst": 100.0}
    return {
        part: {name: float(np.percentile(rows[:, i], q)) for name, q in points.items()} for i, part in enumerate(_PARTS)
    }


def _error(track: np.ndarray, run: Flight) -> float:
    """Root mean square angle between estimated and true attitude once settled, degrees."""
    kept = track[track[:, 0] > _SETTLED]
    true = Rotation.from_euler("ZYX", run.angles[np.rint(kept[:, 0] * _RATE).astype(int), ::-1])
    found = Rotation.from_quat(kept[:, [2, 3, 4, 1]])
    return float(np.sqrt(np.mean((found * true.inv()).magnitude() ** 2)) / _DEGREE)


def _undisturbed() -> str:
    """This process first on one core, as a flight computer's loop would be, where the system lets it."""
    try:
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(10))
    except (AttributeError, PermissionError):
        return "ordinary"
    return "real-time, one core"


def _draw(path: Path, spent: dict[str, np.ndarray]) -> None:
    figure, axes = plt.subplots(1, len(spent), figsize=(3.6 * len(spent), 4.2), sharey=True, layout="constrained")
    colours = ("#9fb9cf", "#6f9bc4", "#1f4e79", "k")
    bins = np.geomspace(5.0, 5e4, 121)
    for axis, (name, rows) in zip(axes, spent.items(), strict=True):
        for i, (part, colour) in enumerate(zip(_PARTS, colours, strict=True)):
            filled = "stepfilled" if i < 3 else "step"
            axis.hist(1e6 * rows[_WARM:, i], bins, histtype=filled, color=colour, alpha=0.8, label=part)
        axis.axvline(1e6 * _TARGET, color="#b5482a", ls="--", label="200 µs")
        axis.axvline(1e6 * _BUDGET, color="#b5482a", ls="-", label="budget: a frame on the line")
        axis.set(xscale="log", yscale="log", xlabel="µs", title=name)
    axes[0].set_ylabel("cycles")
    axes[-1].legend(frameon=False, fontsize=8)
    figure.savefig(path, dpi=120)
    plt.close(figure)


def run(out: Path, quick: bool) -> dict:
    """Fly with a perfect and with a faulty link, time and draw; the numbers."""
    # before JAX starts its threads, which are then scheduled alike
    scheduling = _undisturbed()
    rng = np.random.default_rng(68332)
    whole = flight(120.0 if quick else 600.0, rng)
    lines = {"perfect": link.Line(rng), "faulty": link.Line(rng, **_FAULTS)}
    sent = {name: arrivals(whole, line) for name, line in lines.items()}
    latency, attitude, spent, links, missed = {}, {}, {}, {}, {}
    ready = {
        f"{rule_name}{said}": programs(rule, compiler)
        for rule_name, rule in _rules().items()
        for said, compiler in _COMPILERS.items()
    }
    for rule_name, runs in ready.items():
        for name, data in sent.items():
            p99, flown = [], None
            for _ in range(1 if quick else 5):
                flown = _flown(runs, data)
                p99.append(_latency(np.array(flown.spent))["filter"]["p99"])
            assert flown is not None
            rows, key = np.array(flown.spent), f"{rule_name}, {name} link"
            spent[key] = rows
            latency[key] = {**_latency(rows), "filter_p99_of_runs": p99, "compile_s": runs.compile_s}
            missed[key] = int(np.sum(rows[_WARM:, 3] > _BUDGET))
            attitude[key] = _error(np.array(flown.track), whole)
            decoder = flown.decoder
            links[name] = {"sent": len(whole.times), "good": decoder.good, "bad": decoder.bad}
    few = sent["faulty"][: _WARM + (100 if quick else 500)]
    paced = np.array(_flown(ready["consistent in C"], few, 1.0 / _RATE).spent)
    kept = {key: rows for key, rows in spent.items() if "faulty" in key}
    _draw(out / "latency.png", {**kept, "consistent in C, faulty link, at 25 Hz": paced})
    return {
        "latency": latency,
        "latency_paced": _latency(paced),
        "budget_us": 1e6 * _BUDGET,
        "cycles": {key: len(rows) - _WARM for key, rows in spent.items()},
        "missed_budget": missed,
        "attitude_error_deg": attitude,
        "links": links,
        "scheduling": scheduling,
        "load": os.getloadavg()[0],
    }
