"""Where and when a recording differs from the model: the missing generalised force, sensors and actuators.

In each equation the disturbance of a view is smoothed: the force given all samples, with its band. How much of the
mismatch lies in an equation is what the recordings lose in likelihood when its disturbance is taken away; how much at a
sensor or an actuator, what the best effect there gains.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from ...effects import AbstractEffect, AbstractInstrument, Motion, RunVariation, by_name, numbers, velocities
from ...likelihood import Disturbance
from ...recording import Recording
from .. import settings
from ..linearise.columns import columns_of, differences, prescribed_columns
from ..linearise.evidence import Evidence
from ..linearise.prescribed import on_prescribed
from ..linearise.view import View, missing_force
from ..propose.selector import Scan
from ..records.diagnosis import ForceTrace, Location, Regime
from .effect_forces import Forces
from .process_noise import NoiseSignal
from .regime import INCIDENCE, regime, regime_variables

# missing force over its standard deviation from which it is significant, also where process noise rises too
_SIGMAS, _SUPPORTED_SIGMAS = 2.5, 1.5
# gap between significant intervals that are listed as one, of the run
_GAP = 0.02
# most variables that are listed as those a force grows with, least share of the best one's score, and least score
_VARIABLES, _SCORE_SHARE, _LEAST_SCORE = 3, 0.8, 4.0


@dataclasses.dataclass(frozen=True)
class Field:
    """The missing force of every equation in every run, and how much of the mismatch each place holds.

    **Fields**

    - `share`: by place. `traces`: a `ForceTrace` a run, at its samples.
    - `signals`: a `NoiseSignal` a run, or none: where a filter needs more process noise than the model.
    """

    share: dict[str, float]
    traces: list[ForceTrace]
    signals: Sequence[NoiseSignal] = ()


def traces(
    view: View, recordings: Sequence[Recording], effects: tuple[Forces, Forces] | None = None
) -> list[ForceTrace]:
    """The force that the model lacks in each of `recordings`, with that of its `effects` by recordings and modelled."""
    equations, states = view.vehicle.layout.equations, by_name(view.path.start)
    mean, spread = missing_force(view)
    found = []
    for run, recording in enumerate(recordings):
        k = len(recording.times)
        of = lambda values, run=run, k=k: dict(zip(equations, values[run, :k].T, strict=True))
        # of each interval the start: the last sample begins none
        at_start = lambda values, run=run, k=k: np.append(values[run, : k - 1], np.nan)
        by_equation = lambda force, at=at_start: {e: at(force[..., i]) for i, e in enumerate(equations)}
        found.append(
            ForceTrace(
                recording.name,
                recording.times,
                of(mean),
                of(spread),
                *(({}, {}) if effects is None else (by_equation(effects[0]), by_equation(effects[1]))),
                {name: at_start(np.asarray(value)) for name, value in states.items() if np.ndim(value) == 2},
            )
        )
    return found


def shares(view: View, scan: Scan) -> dict[str, float]:
    """How much of the mismatch each equation, sensor and actuator may hold."""
    whole = _likelihood(view, view.disturbance)
    found: dict[str, float] = {}
    for i, equation in enumerate(view.vehicle.layout.equations):
        without = np.where(np.arange(len(view.vehicle.layout.equations)) == i, 1e-3, 1.0) * view.disturbance.force
        found[equation] = max(0.0, whole - _likelihood(view, dataclasses.replace(view.disturbance, force=without)))
    for effect, statistic, right in zip(scan.effects, scan.statistic, scan.right, strict=True):
        for place in effect.where if right and _on_device(effect) else ():
            found[place] = max(found.get(place, 0.0), 0.5 * float(statistic) / len(effect.where))
    total = max(sum(found.values()), 1e-300)
    return {place: part / total for place, part in found.items()}


def _likelihood(view: View, disturbance: Disturbance) -> float:
    parts, spreads = view.products(view.own, disturbance)
    gram = np.sum(parts, axis=0) + view.prior
    squares = gram[0, 0] - gram[1:, 0] @ np.linalg.solve(gram[1:, 1:], gram[1:, 0])
    return -0.5 * float(squares) - float(np.sum(spreads))


def effect_shares(view: View, effects: Sequence[AbstractEffect], disturbance: Disturbance) -> dict[str, float]:
    """How the trace of accepted effects divides among the equations, actuators and sensors they act on."""
    pushed, shown = [], []
    equations, channels = view.vehicle.layout.equations, view.vehicle.layout.channels
    varying = [effect for effect in effects if isinstance(effect, RunVariation)]
    effects = [effect for effect in effects if not isinstance(effect, RunVariation)]
    before = [effect for effect in effects if on_prescribed(effect, view.vehicle)]
    effects = [effect for effect in effects if not on_prescribed(effect, view.vehicle)]
    for effect, whole in zip(effects, differences(view, effects), strict=True):
        if isinstance(effect, AbstractInstrument):
            shown += [(f"sensor:{c}", whole * (np.asarray(channels) == c)) for c in effect.channels]
        elif _on_device(effect):
            pushed.append((effect.where[0], whole))
        else:
            pushed += [(e, whole * (np.arange(len(equations)) == i)) for i, e in enumerate(equations)]
    columns = columns_of(view, [c for _, c in pushed], [c for _, c in shown]) + prescribed_columns(view, before)
    free = [row.name for row in view.vehicle.layout.free]
    varied = [free.index(effect.number) for effect in varying]
    evidence = Evidence.of(view, columns, [disturbance], varied)
    left = evidence.products[0].unabsorbed() * evidence.length**2
    found: dict[str, float] = {}
    for k, effect in enumerate(varying):
        size = numbers(effect)["spread"] * view.length[varied[k]]
        part = float(np.trace(evidence.products[0].left_by_run([], k))) * size**2
        found |= {place: found.get(place, 0.0) + part / len(effect.where) for place in effect.where}
    places = [*(place for place, _ in (*pushed, *shown)), *(effect.where[0] for effect in before)]
    for place, part in zip(places, np.maximum(left, 0.0), strict=True):
        found[place] = found.get(place, 0.0) + float(part)
    total = max(sum(found.values()), 1e-300)
    return {place: part / total for place, part in found.items()}


def _on_device(effect: AbstractEffect) -> bool:
    """Whether an effect lies at an actuator or a sensor, and not in equations."""
    return all(":" in place for place in effect.where)


def locations(field: Field, view: View, recordings: Sequence[Recording], share: dict[str, float]) -> list[Location]:
    """The places with a share worth naming, the largest first."""
    found = []
    for place, part in sorted(share.items(), key=lambda item: -item[1]):
        if part < settings.PLACE_SHARE:
            continue
        if place in view.vehicle.layout.equations:
            clear = [_clear(trace, place, field.signals) for trace in field.traces]
            times = [hit for trace, own in zip(field.traces, clear, strict=True) for hit in _intervals(trace, own)]
            grows, common = grows_with(view, place), _regime(view, clear)
        else:
            times = [(r.name, float(r.times[0]), float(r.times[-1])) for r in recordings]
            grows, common = [place.partition(":")[2]], None
        found.append(Location(place, round(part, 4), times, grows, common))
    return found


def _regime(view: View, clear: Sequence[np.ndarray]) -> Regime | None:
    """What the samples of each run at which a force is `clear` of its band have in common."""
    variables = regime_variables(view.path.start)
    shape = next(iter(variables.values())).shape if variables else (len(clear), 0)
    inside, live = np.zeros(shape, bool), np.zeros(shape, bool)
    for own, there, run in zip(inside, live, clear, strict=True):
        count = min(len(run), len(own))
        own[:count], there[:count] = run[:count], True
    found = regime(variables, inside, live)
    if found is None:
        return None
    name = found.variable.removeprefix("abs(").removesuffix(")")
    return dataclasses.replace(found, unit="rad" if name in INCIDENCE else view.vehicle.layout.unit(name))


def _clear(trace: ForceTrace, equation: str, signals: Sequence[NoiseSignal]) -> np.ndarray:
    """The samples (K,) at which a force exceeds its band; of fewer sigmas where the filter agrees."""
    size = np.abs(trace.force[equation]) / np.maximum(trace.band[equation], 1e-300)
    clear = size > _SIGMAS
    for signal in signals:
        if signal.run == trace.run:
            clear |= (size > _SUPPORTED_SIGMAS) & signal.rises(equation, trace.times)
    return clear


def _intervals(trace: ForceTrace, clear: np.ndarray) -> list[tuple[str, float, float]]:
    """The times of `clear` samples, those that are close together as one interval."""
    at = np.flatnonzero(clear)
    if not len(at):
        return []
    gap = _GAP * (trace.times[-1] - trace.times[0])
    cuts = np.flatnonzero(np.diff(trace.times[at]) > gap) + 1
    parts = np.split(at, cuts)
    return [(trace.run, float(trace.times[part[0]]), float(trace.times[part[-1]])) for part in parts]


def grows_with(view: View, equation: str) -> list[str]:
    """The variables with which a force in `equation` would have to grow to explain the recordings, best first.

    Each is scored like a candidate effect: a force proportional to it, what the coefficients can absorb projected off.
    """
    starts, ends = motion_variables(view.path.start), motion_variables(view.path.end)
    names = [name for name in starts if name in ends]
    equations = view.vehicle.layout.equations
    own = np.eye(len(equations))[equations.index(equation)]
    pushed = [np.stack([motion[name] for motion in (starts, ends)])[..., None] * own for name in names]
    evidence = Evidence.of(view, columns_of(view, pushed), [view.disturbance])
    gain = evidence.products[0].gains([], [[i] for i in range(len(names))]).statistic
    ranked = np.argsort(-gain)[:_VARIABLES]
    return [names[i] for i in ranked if gain[i] > _SCORE_SHARE * gain[ranked[0]] and gain[i] > _LEAST_SCORE]


def motion_variables(motion: Motion) -> dict[str, np.ndarray]:
    """What a force may grow with: velocities, positions, inputs, their sizes and products, each (R, K-1)."""
    named = {name: np.asarray(value) for name, value in by_name(motion).items()}
    moving = {k: v for k, v in named.items() if np.ndim(v) == 2 and np.std(v) > 1e-9}
    grown = {k: v for k, v in moving.items() if k in velocities(motion)}
    variables = dict(moving)
    variables |= {f"abs({k})": np.abs(v) for k, v in moving.items()}
    variables |= {f"{k}*abs({k})": v * np.abs(v) for k, v in grown.items()}
    turning = [k for k in ("u", "v", "w", "p", "q", "r") if k in grown]
    variables |= {f"{a}*{b}": grown[a] * grown[b] for i, a in enumerate(turning) for b in turning[i + 1 :]}
    return variables
