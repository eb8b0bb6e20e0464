r"""Where and when a recording differs from the model: the generalised force that the residual asks for.

In each run the missing force of each equation is a sum of hat functions of time with Gaussian weights of unknown
variance, one variance an equation; sensors may be off by a constant, a scale and a drift, actuators late. Maximising
the evidence over those variances (Tipping's automatic relevance determination, 2001) leaves variance only where the
data ask for it, which is the location; the posterior mean is the force and its spread the band.
"""

import dataclasses
from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ..effects import VELOCITIES, AbstractEffect, AbstractForce, Motion, candidates
from ..effects.actuators import ActuatorLag
from ..effects.sensors import SensorBias, SensorDrift, SensorScale
from ..estimate import Fit
from ..likelihood import force_columns
from ..recording import Recording
from .columns import Trajectory, candidate_columns, facts, stacked_force
from .diagnosis import ForceTrace, Location
from .process_noise import NoiseSignal
from .scan import project

HATS = 40
_ROUNDS = 25
_SIGNIFICANT = 2.5
# of a force where the filter's process noise rises too
_SUPPORTED = 1.5
_SHOWN = 0.05


@dataclasses.dataclass(frozen=True)
class Field:
    """The missing force of every equation in every run, and how much of the mismatch each place holds.

    **Fields**

    - `share`: by place, of the residual's squares that all places explain together.
    - `traces`: a `ForceTrace` a run, at the hats' centres.
    - `signals`: a `NoiseSignal` a run, or none: where a filter needs more process noise than the model.
    """

    share: dict[str, float]
    traces: list[ForceTrace]
    signals: Sequence[NoiseSignal] = ()


def locate(fit: Fit, path: Trajectory, recordings: Sequence[Recording], signals: Sequence[NoiseSignal] = ()) -> Field:
    """The missing forces of a fit, with what a filter's process noise said of when and in which equation."""
    equations = fit.vehicle.layout.equations
    hats = _hats(fit)
    suspects = candidates(facts(fit.vehicle, fit), (ActuatorLag, SensorBias, SensorScale, SensorDrift))
    columns, owners = candidate_columns(fit, path, suspects)
    places = [e for e in equations for _ in range(HATS)] + [suspects[i].where[0] for i in owners]
    projected, _, residual = project(fit, jnp.concatenate([hats, columns], axis=-1))
    S, r = np.asarray(projected), np.asarray(residual)
    normal = [s.reshape(-1, s.shape[-1]).T @ s.reshape(-1, s.shape[-1]) for s in S]
    towards = [s.reshape(-1, s.shape[-1]).T @ e.ravel() for s, e in zip(S, r, strict=True)]
    # every column in units of its own weight in the data, so that one start suits forces, scales and drifts
    size = np.sqrt(np.maximum(np.mean([np.diag(n) for n in normal], axis=0), 1e-300))
    normal = [n / np.outer(size, size) for n in normal]
    towards = [t / size for t in towards]
    noise = _noise(fit, r)
    mean, spread, share = _relevance([n / noise for n in normal], [t / noise for t in towards], places)
    traces = []
    for run, recording in enumerate(recordings):
        t = np.linspace(recording.times[0], recording.times[-1], HATS)
        pick = {e: slice(i * HATS, (i + 1) * HATS) for i, e in enumerate(equations)}
        force = {e: mean[run][s] / size[s] for e, s in pick.items()}
        band = {e: spread[run][s] / size[s] for e, s in pick.items()}
        traces.append(ForceTrace(recording.name, t, force, band))
    return Field(share, traces, signals)


def _hats(fit: Fit) -> Array:
    """Outputs per unit of each hat of each equation, (R, K, c, n HATS); the hats spread over each run's own time."""
    times, n = np.asarray(fit.runs.times), len(fit.vehicle.layout.equations)
    live = np.asarray(fit.runs.live).sum(1)
    phase = np.stack([t / t[k] * (HATS - 1) for t, k in zip(times, live, strict=True)])
    hat = np.maximum(0.0, 1.0 - np.abs(phase[..., None] - np.arange(HATS)))
    ends = np.einsum("rkb,ij->rkijb", hat, np.eye(n)).reshape(*hat.shape[:2], n, n * HATS)
    return force_columns(fit.model, jnp.asarray(ends[:, :-1]), jnp.asarray(ends[:, 1:]))


def _noise(fit: Fit, residual: np.ndarray) -> float:
    """How many samples one independent sample stands for, at least 1: (1 + ρ)/(1 - ρ) of the residual's lag-one ρ."""
    mask = np.asarray(fit.runs.mask)
    both = mask[:, 1:] & mask[:, :-1]
    rho = np.sum(residual[:, 1:] * residual[:, :-1] * both) / max(np.sum(residual**2), 1e-300)
    # only the white part of the residual is noise here, so a strong correlation must not hide what is sought
    rho = float(np.clip(rho, 0.0, 0.5))
    return (1.0 + rho) / (1.0 - rho)


def _relevance(
    normal: list[np.ndarray], towards: list[np.ndarray], places: list[str]
) -> tuple[list[np.ndarray], list[np.ndarray], dict[str, float]]:
    """Posterior mean and spread of the weights in each run, and each place's share, by evidence maximisation."""
    names = list(dict.fromkeys(places))
    group = np.array([names.index(place) for place in places])
    count = np.bincount(group) * len(normal)
    variance = np.ones(len(names))
    for _ in range(_ROUNDS):
        root = np.sqrt(variance[group])
        inner = [np.linalg.inv(np.eye(len(root)) + root[:, None] * n * root) for n in normal]
        covariance = [root[:, None] * m * root for m in inner]
        mean = [c @ t for c, t in zip(covariance, towards, strict=True)]
        squares = sum(m**2 for m in mean)
        # MacKay's fixed point: squares over the number of weights that the data determine
        determined = sum(1.0 - np.diag(m) for m in inner)
        well = np.maximum(np.bincount(group, determined), 1e-12)
        variance = np.bincount(group, squares) / well
        variance = np.where(well < 1e-6 * count, 0.0, np.clip(variance, 0.0, 1e12))
    gains = np.array([sum(2.0 * m * t - m * (n @ m) for m, t, n in zip(mean, towards, normal, strict=True))])[0]
    by_place = np.maximum(np.bincount(group, gains), 0.0)
    share = dict(zip(names, (by_place / max(by_place.sum(), 1e-300)).tolist(), strict=True))
    return mean, [np.sqrt(np.diag(c)) for c in covariance], share


def locations(
    field: Field, fit: Fit, path: Trajectory, recordings: Sequence[Recording], share: dict[str, float] | None = None
) -> list[Location]:
    """The places with a share worth naming, the largest first: `share` overrides the field's own."""
    share = field.share if share is None else share
    found = []
    for place, part in sorted(share.items(), key=lambda item: -item[1]):
        if part < _SHOWN:
            continue
        if place in fit.vehicle.layout.equations:
            times = [hit for trace in field.traces for hit in _intervals(trace, place, field.signals)]
            grows = grows_with(fit, path, place)
        else:
            times = [(r.name, float(r.times[0]), float(r.times[-1])) for r in recordings]
            grows = [place.partition(":")[2]]
        found.append(Location(place, round(part, 4), times, grows))
    return found


def _intervals(trace: ForceTrace, equation: str, signals: Sequence[NoiseSignal]) -> list[tuple[str, float, float]]:
    """Times at which a force stands clear of its band, neighbouring hats joined; less clear where a filter agrees."""
    size = np.abs(trace.force[equation]) / np.maximum(trace.band[equation], 1e-300)
    clear = size > _SIGNIFICANT
    for signal in signals:
        if signal.run == trace.run:
            clear |= (size > _SUPPORTED) & signal.rises(equation, trace.times)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], clear.astype(int), [0]])))
    half = 0.5 * (trace.times[1] - trace.times[0])
    low, high = trace.times[0], trace.times[-1]
    return [
        (trace.run, float(max(low, trace.times[a] - half)), float(min(high, trace.times[b - 1] + half)))
        for a, b in zip(edges[::2], edges[1::2], strict=True)
    ]


def grows_with(fit: Fit, path: Trajectory, equation: str, most: int = 3) -> list[str]:
    """The variables with which a force in `equation` would have to grow to explain the residual, best first.

    Each is scored like a candidate effect: a force proportional to it, what the coefficients can absorb projected off.
    """
    starts, ends = motion_variables(path.start), motion_variables(path.end)
    names = [name for name in starts if name in ends]
    equations = fit.vehicle.layout.equations
    own = np.eye(len(equations))[equations.index(equation)]
    push = lambda named: jnp.asarray(np.stack([named[name][..., None] * own for name in names], axis=-1))
    projected, before, residual = project(fit, force_columns(fit.model, push(starts), push(ends)))
    score, after = jnp.einsum("rkcq,rkc->q", projected, residual), jnp.sum(projected**2, (0, 1, 2))
    gain = np.asarray(jnp.where(after > 1e-5 * before, score**2 / jnp.maximum(after, 1e-300), 0.0))
    ranked = np.argsort(-gain)[:most]
    return [names[i] for i in ranked if gain[i] > 0.8 * gain[ranked[0]] and gain[i] > 4.0]


def motion_variables(motion: Motion) -> dict[str, np.ndarray]:
    """What a force may grow with: velocities, positions, inputs, their sizes and products, each (R, K-1)."""
    rates = {VELOCITIES.get(e, f"{e}_rate"): np.asarray(v) for e, v in motion.rates.items()}
    others = {k: np.asarray(v) for k, v in (motion.positions | motion.actuators | motion.environment).items()}
    moving = {k: v for k, v in (rates | others).items() if np.ndim(v) == 2 and np.std(v) > 1e-9}
    grown = {k: v for k, v in moving.items() if k in rates}
    variables = dict(moving)
    variables |= {f"abs({k})": np.abs(v) for k, v in moving.items()}
    variables |= {f"{k}*abs({k})": v * np.abs(v) for k, v in grown.items()}
    turning = [k for k in ("u", "v", "w", "p", "q", "r") if k in grown]
    variables |= {f"{a}*{b}": grown[a] * grown[b] for i, a in enumerate(turning) for b in turning[i + 1 :]}
    return variables


def effect_share(fit: Fit, path: Trajectory, effects: Sequence[AbstractEffect]) -> dict[str, float]:
    """How the trace of accepted effects divides among the equations, actuators and sensors they act on."""
    squares: dict[str, float] = {}
    for effect in effects:
        if isinstance(effect, AbstractForce):
            parts = _by_equation(fit, path, effect)
        else:
            columns, _ = candidate_columns(fit, path, [effect])
            parts = {effect.where[0]: float(jnp.sum(project(fit, columns)[0] ** 2))}
        for place, part in parts.items():
            squares[place] = squares.get(place, 0.0) + part
    total = max(sum(squares.values()), 1e-300)
    return {place: part / total for place, part in squares.items()}


def _by_equation(fit: Fit, path: Trajectory, effect: AbstractForce) -> dict[str, float]:
    """Squares of what an effect's force in each equation alone does to the outputs beyond what coefficients absorb."""
    ends = np.stack([stacked_force(fit.vehicle, effect, motion) for motion in (path.start, path.end)])
    equations = fit.vehicle.layout.equations
    alone = np.einsum("zrkn,nm->zrknm", ends, np.eye(len(equations)))
    columns = force_columns(fit.model, jnp.asarray(alone[0]), jnp.asarray(alone[1]))
    projected, _, _ = project(fit, columns)
    parts = np.sum(np.asarray(projected) ** 2, axis=(0, 1, 2))
    return dict(zip(equations, parts.tolist(), strict=True))
