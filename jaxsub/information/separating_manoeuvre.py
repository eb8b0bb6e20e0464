r"""The next manoeuvre: the inputs, within limits, whose recording would best separate rival explanations.

What is maximised is the smallest separation over the pairs of rivals (`separation.py`), each refitted: the expected
$\chi^2$ by which the wrong one misses what the right one recorded. L-BFGS by gradient through the rivals themselves,
from the best few of the recorded inputs and random telegraph signals.
"""

import dataclasses
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..effects import CHANNEL_UNITS
from ..errors import InputError
from ..estimate import Problem, batch
from ..programs import compiled
from ..recording import Recording
from ..recording.runs import Runs
from ..simulation import sampled_states
from ..vehicle import AbstractVehicle
from .design_limits import Bounds, ManoeuvreLimits, Range
from .design_search import descend, telegraphs
from .separation import Rivals, loss

# of the recorded range of a channel, how far a manoeuvre may leave it on either side; and at least how far
_WIDER, _LEAST = 0.25, {"rad": 0.1, "m": 1.0}
_PARTS = np.linspace(0.0, 1.0, 21)


@dataclasses.dataclass(frozen=True)
class Manoeuvre:
    """A manoeuvre that separates rivals.

    **Fields**

    - `recording`: its inputs. Outputs are blank but for the first row, which holds the state that it begins in.
    - `separation`: expected χ² between the two closest rivals, the wrong one refitted; `before`: of the recorded inputs
      over the same time.
    - `pairs`, `pairs_before`: (R, R) for each truth (row) and rival (column).
    - `within`: the largest part of its limit that any channel takes, 1 at the limit.
    - `tried`: the separation of each start, drawn inside the limits, by name.
    - `start`: what the best search set out from. `history`: minus its loss, the logarithm of a smooth minimum of the
      separations less a penalty, after each evaluation; empty where no search improved on its start.
    """

    recording: Recording
    separation: float
    before: float
    pairs: np.ndarray
    pairs_before: np.ndarray
    within: float
    tried: dict[str, float]
    start: str
    history: list[float]


def separating_manoeuvre(
    models: Sequence[AbstractVehicle],
    like: Recording,
    sigma: Float[Array, " c"] | np.ndarray,
    limits: ManoeuvreLimits | None = None,
    duration: float | None = None,
    interval: float | None = None,
    *,
    searches: int = 3,
    steps: int = 60,
    seed: int = 0,
) -> Manoeuvre:
    """The inputs that best separate `models`, each the vehicle with one rival effect fitted to what `like` is of.

    The manoeuvre begins where `like` does, measures the same channels, each in the same share of the samples, with
    noise `sigma` (c,) SI, and keeps `limits`, by default `recorded_limits`. It lasts `duration` s, sampled every
    `interval` s: by default as `like`. Interpolated columns are those of `like`, the last value beyond its end.

    The best `searches` of the recorded inputs and random telegraph signals are improved by at most `steps` of L-BFGS.
    What leaves the limits of a channel is drawn towards the recorded inputs until it is inside.

    **Raises** `InputError` for fewer than two models, models of different vehicles or without an actuator, limits that
    do not fit them, and an input column of `like` that is absent or has a gap.
    """
    _require_rivals(models)
    sigma = jnp.asarray(sigma)
    recorded = batch(models[0], [like])
    limits = limits or recorded_limits(models[0], like)
    step = float(np.median(np.diff(like.times))) if interval is None else interval
    times = step * np.arange(round((like.duration if duration is None else duration) / step) + 1)
    run, used = _blank(models, like, times)
    bounds = Bounds.of(models[0], limits, times, used[0])
    family = {"recorded inputs": used} | telegraphs(bounds, seed)
    commands = jnp.stack([jnp.asarray(values) for values in family.values()])
    anchor = bounds.follow(commands[0])
    rivals = Rivals.of(models, recorded, run, sigma, bounds, anchor)
    tried = [np.asarray(part) for part in _judged(jax.vmap(bounds.follow)(commands), rivals)]
    order = np.argsort(_nearest(tried[1]))[::-1][:searches]
    ends, losses = descend(loss, jax.vmap(bounds.free)(jnp.asarray(tried[0][order])), rivals, steps)
    # as many as there were starts, so that judging them is compiled once
    again = np.resize(np.arange(len(order)), len(family))
    found = [np.asarray(part) for part in _judged(jax.vmap(bounds.inputs)(ends[again]), rivals)]
    inputs, pairs, within = (np.concatenate(both) for both in zip(tried, found, strict=True))
    best = int(np.argmax(_nearest(pairs)))
    searched = again[best - len(family)] if best >= len(family) else None
    history = np.empty(0) if searched is None else -np.asarray(losses)[searched]
    return Manoeuvre(
        _recording(models[0], like, times, inputs[best]),
        float(_nearest(pairs)[best]),
        float(_nearest(pairs)[0]),
        pairs[best],
        pairs[0],
        float(within[best]),
        dict(zip(family, _nearest(tried[1]).tolist(), strict=True)),
        list(family)[best if searched is None else order[searched]],
        history[np.isfinite(history)].tolist(),
    )


def recorded_limits(vehicle: AbstractVehicle, like: Recording) -> ManoeuvreLimits:
    """What `like` asked of actuators and vehicle: an actuator between zero and its extremes, no faster than it moved.

    One that never moved has no limit of rate. Attitude and depth of a body, and coordinates of a mechanism, may leave
    their recorded range (that of `vehicle` driven by `like` where they were not measured) by a quarter of it, at least
    by 0.1 rad and 1 m.
    """
    layout = vehicle.layout
    used = like.inputs(layout.held)
    ends = zip(layout.held, np.minimum(used.min(0), 0.0), np.maximum(used.max(0), 0.0), strict=True)
    amplitude: dict[str, Range] = {name: (float(low), float(high)) for name, low, high in ends}
    fastest = np.max(np.abs(np.diff(used, axis=0)) / np.diff(like.times)[:, None], axis=0)
    rate = {name: float(most) for name, most in zip(layout.held, fastest, strict=True) if most > 0.0}
    runs = batch(vehicle, [like])
    states = sampled_states(vehicle, runs, Problem.of(vehicle, runs, jnp.ones(len(layout.channels))).guess)[0]
    shown = vehicle.channels(vehicle.motion(states, runs.signals[0]))
    body = layout.kind == "submerged-body"
    channels: dict[str, Range] = {}
    for name in filter(layout.tells, ("phi", "theta", "z")) if body else layout.equations:
        seen = like.columns.get(name, np.full(1, np.nan))
        seen = seen[np.isfinite(seen)] if np.isfinite(seen).any() else np.asarray(shown[name])
        low, high = float(seen.min()), float(seen.max())
        wider = max(_WIDER * (high - low), _LEAST[CHANNEL_UNITS[name]] if body else 1e-6)
        channels[name] = (low - wider, high + wider)
    return ManoeuvreLimits(amplitude, rate, channels)


@compiled
def _judged(
    tried: Float[Array, "b k m"], rivals: Rivals
) -> tuple[Float[Array, "b k m"], Float[Array, "b r r"], Float[Array, " b"]]:
    """Inputs, drawn to the recorded ones as far as channels ask; their separations; the part of their limits they take.

    Where the recorded inputs themselves leave a limit, it is enough to be as near to it as they are.
    """
    toward = rivals.anchor + _PARTS[:, None, None] * (tried[:, None] - rivals.anchor)
    taken = jnp.max(jax.vmap(jax.vmap(rivals.excess))(toward), axis=(2, 3), initial=0.0)
    inside = taken <= jnp.maximum(taken[:, :1], 1.0)
    # the largest part up to which all are inside
    part = jnp.sum(jnp.cumprod(inside, axis=1), axis=1) - 1
    row = jnp.arange(len(tried))
    chosen = toward[row, part]
    return chosen, jax.lax.map(rivals.separations, chosen), taken[row, part]


def _nearest(pairs: np.ndarray) -> np.ndarray:
    """The smallest separation of each, minus infinity where a rival diverges."""
    least = np.min(pairs, axis=(1, 2))
    return np.where(np.isfinite(least), least, -np.inf)


def _blank(models: Sequence[AbstractVehicle], like: Recording, times: np.ndarray) -> tuple[Runs, np.ndarray]:
    """A run at `times` with every channel to be measured, and the held inputs of `like` (K, m), over and over."""
    layout = models[0].layout
    source = like.times - like.times[0]
    turn = (
        np.searchsorted(source, np.mod(times, source[-1] + np.diff(source)[-1]) + 1e-9 * source[-1], side="right") - 1
    )
    used = like.inputs(layout.held)[turn]
    columns = {name: np.zeros(len(times)) for name in layout.columns} | _around(layout.interpolated, like, times)
    columns |= dict(zip(layout.held, used.T, strict=True))
    blank = Recording("next manoeuvre", times, columns, "next manoeuvre")
    return max((batch(model, [blank]) for model in models), key=lambda runs: runs.substeps), used


def _around(names: Sequence[str], like: Recording, times: np.ndarray) -> dict[str, np.ndarray]:
    """Interpolated columns at `times` from the start of `like`, the last value beyond its end."""
    surroundings = like.inputs(names).T
    return {n: np.interp(times, like.times - like.times[0], c) for n, c in zip(names, surroundings, strict=True)}


def _recording(vehicle: AbstractVehicle, like: Recording, times: np.ndarray, inputs: np.ndarray) -> Recording:
    """The inputs as a recording, the first row with the first sample of each measured channel of `like`."""
    layout = vehicle.layout
    columns = {}
    for name in layout.columns:
        seen = like.column(name)[np.isfinite(like.column(name))]
        columns[name] = np.where(np.arange(len(times)) == 0, seen[0] if len(seen) else np.nan, np.nan)
    columns |= _around(layout.interpolated, like, times)
    columns |= dict(zip(layout.held, inputs.T, strict=True))
    return Recording("next manoeuvre", times, columns, "next manoeuvre")


def _require_rivals(models: Sequence[AbstractVehicle]) -> None:
    """Raise `InputError` unless `models` are two or more of one vehicle that has an actuator."""
    if len(models) < 2:
        raise InputError("models", f"{len(models)} was given", "give the rivals that are to be separated")
    layout = models[0].layout
    if not layout.held:
        raise InputError(f"vehicle {layout.name!r}", "has no actuator", "a manoeuvre moves one")
    for other in models[1:]:
        named = lambda layout: (layout.equations, layout.held, layout.interpolated, layout.channels)
        if named(other.layout) != named(layout):
            raise InputError("models", "are of different vehicles", "give one vehicle with one rival each")
