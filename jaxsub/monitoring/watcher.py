"""A vehicle watched row by row: events when its innovations say that something changed, where and since when."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ..navigation import ahead_of_time
from ..recording import Recording
from ..vehicle import AbstractVehicle
from .calibration import HOURS, Tail, calibrated
from .monitor import Monitor, MonitorState, Observation
from .naming import NAMED_AT, Recent, named_effects
from .setup import LONGEST, WatchedModel, initial_state, model_by_noise, model_of, monitor_of, rows_of
from .stored import Stored, read_stored, write_stored

# times the statistic of the last event about a standing alarm, at which there is another
_GROWTH = 2.0
# times the threshold, of a statistic beyond which the time of the change is not estimated anew: longer windows, which
# began before it, then have larger ones
_CLEAR = 4.0

Event = dict[str, Any]


@dataclasses.dataclass
class Watcher:
    """Watches a vehicle by rows of time, signals and outputs.

    **Fields**

    - `model`: of the vehicle, as its filter assumes it. `monitor`: with its threshold. `tail`: of false alarms.
    - `rate`: false alarms per hour.
    - `state`: before the next row. `samples`: rows so far. `alarms`: alarms so far. `time`: s, of the last row used.
    - `place`, `since`, `reported`: of the alarm that stands: where, since when (s), and the statistic last reported.
    - `recent`: the last rows. `named`: how often the alarm that stands was named.
    """

    model: WatchedModel
    monitor: Monitor
    tail: Tail
    rate: float
    state: MonitorState
    samples: int = 0
    alarms: int = 0
    reported: float = 0.0
    place: str = ""
    since: float = float("nan")
    time: float = float("nan")
    recent: Recent = dataclasses.field(default_factory=Recent)
    named: int = 0

    def __post_init__(self) -> None:
        row = np.zeros(1 + len(self.monitor.held) + self.monitor.sigma.size)
        self._program = ahead_of_time(self.monitor, self.state, row)
        self._packed = self._program.pack(self.state)
        layout = self.model.vehicle.layout
        self.places = (*layout.equations, *(f"sensor:{channel}" for channel in layout.channels))

    @classmethod
    def of(
        cls,
        vehicle: AbstractVehicle,
        first: Float[np.ndarray, "k w"],
        clean: Sequence[Recording] = (),
        *,
        false_alarms_per_hour: float = 0.01,
        longest: float = LONGEST,
        interval: float | None = None,
        hours: float = HOURS,
        seed: int = 0,
    ) -> "Watcher":
        """A watcher of `vehicle`, calibrated on `clean` runs, or where there are none by its sensors' noise alone.

        The threshold is that of `false_alarms_per_hour`.
        The state begins where the `first` rows (K, w) are: time, signals and outputs, SI, NaN where missing. Changes
        are looked for over up to `longest` s. `interval` is the usual time between rows, s; by default that of the
        clean runs, or of the first rows. `hours` of innovations are drawn to calibrate, by the random `seed`.

        **Raises** `InputError` for outputs without sigma, and clean runs that are too short or that no filter follows.
        """
        if clean:
            model, runs = model_of(vehicle, clean), clean
            model = model._replace(interval=model.interval if interval is None else interval)
        else:
            times = first[np.isfinite(first[:, 0]), 0]
            usual = float(np.median(np.diff(times))) if interval is None else interval
            model, runs = model_by_noise(vehicle, usual)
        model = model._replace(longest=longest)
        monitor = monitor_of(model)
        rows = rows_of(model.vehicle, runs, gap=2.0 * monitor.stream.longest)
        begun = monitor.start(initial_state(model, rows[:1]))
        found = calibrated(monitor, begun, rows, false_alarms_per_hour, white=not clean, hours=hours, seed=seed)
        state = found.monitor.start(initial_state(model, first))
        return cls(model, found.monitor, found.tail, false_alarms_per_hour, state)

    def step(self, row: Float[np.ndarray, " w"]) -> list[Event]:
        """Events after a further `row` (1 + m + c,) of time, signals and outputs, SI, NaN where missing."""
        self._packed, found = self._program.step(self._packed, row)
        self.samples += 1
        if not found.taken:
            return []
        self.time = float(row[0])
        self.recent.add(np.array(row), found.estimate.x[: len(self.model.start_std)])
        return [*self._events(found), *self._names()]

    def _names(self) -> list[Event]:
        """An event that names the effects of the alarm that stands, whenever there is much more evidence."""
        if not self.place or self.named == len(NAMED_AT) or not self.recent.full:
            return []
        if self.recent.since(self.since) < NAMED_AT[self.named]:
            return []
        self.named += 1
        effects = named_effects(self.model, self.recent, self.since)
        return [{"event": "named", "alarm": self.alarms, "time": self.time, "effects": effects}]

    def _events(self, found: Observation) -> list[Event]:
        events: list[Event] = []
        standing = self.place != ""
        if found.raised:
            self.alarms += 1
            self.named = 0
        channels = self.model.vehicle.layout.channels
        jumped = [f"sensor:{name}" for name, there in zip(channels, found.recovered, strict=True) if there]
        statistic = float(found.statistic)
        place = jumped[0] if jumped else self.places[int(found.change)]
        grown = statistic > _GROWTH * self.reported
        if found.raised or (standing and bool(jumped)) or (standing and grown and statistic > self.threshold):
            kind = "alarm" if found.raised else "update"
            events.append(self._alarm(kind, found, place, bool(jumped)))
            self.place, self.reported = place, max(statistic, self.reported if standing else 0.0)
        if found.ended:
            events.append({"event": "end", "alarm": self.alarms, "time": self.time})
            self.place, self.reported = "", 0.0
        return events

    def _alarm(self, kind: str, found: Observation, place: str, jumped: bool) -> Event:
        n, c = self.monitor.process.force.size, int(found.change)
        unit = float(self.monitor.sigma[c - n]) if c >= n else 1.0
        since = self.time - float(found.age) * self.model.interval
        if jumped:
            since = self.time - self.monitor.filter.gate.patience * self.model.interval
        elif kind == "update" and found.statistic > _CLEAR * self.threshold:
            since = self.since
        self.since = since
        return {
            "event": kind,
            "alarm": self.alarms,
            "time": self.time,
            "since": since,
            "place": place,
            "or": [] if jumped else [self.places[i] for i in np.flatnonzero(found.likely) if i != c],
            "statistic": float(found.statistic),
            "threshold": self.threshold,
            "false_alarms_per_hour": min(self.rate, self.tail.rate_of(float(found.statistic))),
            **({} if jumped else {"size": unit * float(found.size), "standard_error": unit * float(found.size_std)}),
        }

    @property
    def threshold(self) -> float:
        """Of the statistic."""
        return float(self.monitor.test.threshold)

    def status(self) -> Event:
        """How many rows there were, and what was wrong with them."""
        faults = self.current().stream.faults
        channels = self.model.vehicle.layout.channels
        named = lambda v: int(v) if np.ndim(v) == 0 else {n: int(k) for n, k in zip(channels, v, strict=True) if k}
        counted = {name: named(np.asarray(value)) for name, value in vars(faults).items()}
        return {
            "event": "status",
            "time": self.time,
            "samples": self.samples,
            "alarms": self.alarms,
            "faults": {name: count for name, count in counted.items() if count},
        }

    def current(self) -> MonitorState:
        """The state of the filter and the test."""
        return self._program.unpack(self._packed)

    def save(self, path: Path, **more: Any) -> None:
        """Write all that is needed to go on, and `more`, to `path`, in one step.

        **Raises** `OSError` where it cannot be written.
        """
        numbers = {
            "rate": self.rate,
            "samples": self.samples,
            "alarms": self.alarms,
            "reported": self.reported,
            "place": self.place,
            "since": self.since,
            "time": self.time,
            "tail": list(self.tail),
            "named": self.named,
            "recent": len(self.recent.rows),
        }
        arrays = [np.asarray(leaf) for leaf in jax.tree.leaves((self.current(), self.monitor.test))]
        kept = [*self.recent.rows, *self.recent.states]
        write_stored(path, Stored(self.model, numbers | more, [*arrays, np.concatenate([np.zeros(0), *kept])]))

    @classmethod
    def restored(cls, path: Path, vehicle: AbstractVehicle) -> tuple["Watcher", dict[str, Any]]:
        """The watcher of `vehicle` as it was when `path` was written, and what else was.

        **Raises** `InputError` for a file that is no state of this vehicle.
        """
        found = read_stored(path, vehicle)
        numbers = dict(found.numbers)
        monitor = monitor_of(found.model)
        like = monitor.start(jnp.zeros(len(vehicle.layout.states))), monitor.test
        leaves, structure = jax.tree.flatten(like)
        state, test = jax.tree.unflatten(structure, [jnp.asarray(own) for own in found.arrays[: len(leaves)]])
        monitor = dataclasses.replace(monitor, test=test)
        tail, rate = Tail(*numbers.pop("tail")), numbers.pop("rate")
        own = {name: numbers.pop(name) for name in ("samples", "alarms", "reported", "place", "since", "time", "named")}
        own["recent"] = _recent(found, numbers.pop("recent"))
        return cls(found.model, monitor, tail, rate, state, **own), numbers


def _recent(found: Stored, count: int) -> Recent:
    """The rows and states that a file keeps last, `count` of each."""
    states = len(found.model.start_std)
    flat = found.arrays[-1]
    rows, kept = np.split(flat, [flat.size - count * states])
    return Recent(list(rows.reshape(count, -1)) if count else [], list(kept.reshape(count, states)))
