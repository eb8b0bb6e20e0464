"""`jaxsub watch`: one sample at a time against a vehicle's model; alarms as JSON lines."""

import dataclasses
import itertools
import json
import os
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from ..errors import InputError, OutputError
from ..monitoring import Lines, Watcher, is_file, lines_of
from ..plain import plain
from ..vehicle import AbstractVehicle, read_vehicle
from . import session, terminal
from .options import options
from .output import paths_of, require_apart
from .runs import load_runs

# rows by which the start and the usual interval are known
_FIRST = 16
# s between two writings of the state
_SAVED = 10.0


@dataclasses.dataclass(frozen=True)
class Asked:
    """What the command line asks for; fields as the options of `jaxsub watch`."""

    clean: tuple[Path, ...]
    false_alarms_per_hour: float
    out: Path | None
    state: Path | None
    header: str | None
    longest: float
    interval: float | None
    status_every: float


def run(vehicle_path: Path, source: str, asked: Asked) -> None:
    """Write an event a line to standard output, and to `asked.out` where given, until the source ends."""
    session.choose_device()
    session.start(long=True)
    vehicle = read_vehicle(vehicle_path)
    inputs = paths_of(vehicle_path, *asked.clean, Path(source) if is_file(source) else None)
    for path in paths_of(asked.out, asked.state):
        require_apart(path, inputs)
    lines = lines_of(source)
    stored = asked.state is not None and asked.state.exists()
    begin = _resumed if stored else _begun
    watch, done = begin(vehicle, lines, source, asked)
    with _events_file(asked.out, done.written, stored) as out:
        _go_on(watch, done, lines, out, asked)


@dataclasses.dataclass
class _Progress:
    """How far a watch has come: lines taken from its source, bytes written to its file, and rows that wait."""

    reader: Lines
    lines: int
    written: int
    waiting: list[np.ndarray]


def _begun(vehicle: AbstractVehicle, lines: Iterator[str], source: str, asked: Asked) -> tuple[Watcher, _Progress]:
    header = next(lines, "") if asked.header is None else asked.header
    done = _Progress(Lines(header, vehicle.layout, source), int(asked.header is None), 0, [])
    done.waiting = first = list(itertools.islice(_rows(lines, done), _FIRST))
    if len(first) < 2:
        raise InputError(source, f"has {len(first)} samples", "give at least two")
    clean = load_runs(asked.clean, vehicle) if asked.clean else []
    with terminal.progress(f"calibrating on {len(clean) or 'no'} clean runs"):
        watch = Watcher.of(
            vehicle,
            np.stack(first),
            clean,
            false_alarms_per_hour=asked.false_alarms_per_hour,
            longest=asked.longest,
            interval=asked.interval,
        )
    terminal.note(f"threshold {watch.threshold:.1f} for {asked.false_alarms_per_hour:g} false alarms per hour")
    return watch, done


def _resumed(vehicle: AbstractVehicle, lines: Iterator[str], source: str, asked: Asked) -> tuple[Watcher, _Progress]:
    assert asked.state is not None
    watch, more = Watcher.restored(asked.state, vehicle)
    reader = Lines(more["header"], vehicle.layout, source)
    reader.malformed = more["malformed"]
    if is_file(source):
        for _ in itertools.islice(lines, more["lines"]):
            pass
    terminal.note(f"going on after {watch.samples} samples, at {watch.time:g} s")
    return watch, _Progress(reader, more["lines"], more["written"], [])


def _events_file(out: Path | None, written: int, stored: bool) -> AbstractContextManager[BinaryIO | None]:
    """The file of events, without what a process that was killed wrote after its last state; None where none is."""
    if out is None:
        return nullcontext()
    if out.exists() and not stored:
        raise InputError(str(out), "already exists", "choose another --out, or give its --state to go on")
    try:
        file = out.open("ab")
        file.truncate(min(written, file.tell()))
    except OSError as error:
        raise OutputError(str(out), f"cannot be written ({error.strerror})", "choose another --out") from error
    return file


def _go_on(watch: Watcher, done: _Progress, lines: Iterator[str], out: BinaryIO | None, asked: Asked) -> None:
    emit = lambda events: _emit(events, out, done)
    saved = time.monotonic()
    reported = watch.time if np.isfinite(watch.time) else done.waiting[0][0]

    def save() -> None:
        if asked.state is not None:
            _save(watch, done, asked.state)

    try:
        for row in itertools.chain(done.waiting, _rows(lines, done)):
            events = watch.step(row)
            if watch.time - reported >= asked.status_every:
                reported = watch.time
                events.append(_status(watch, done))
            if events:
                emit(events)
            if events or time.monotonic() - saved > _SAVED:
                saved = time.monotonic()
                save()
        emit([{**_status(watch, done), "end": True}])
    finally:
        save()


def _rows(lines: Iterator[str], done: _Progress) -> Iterator[np.ndarray]:
    for line in lines:
        done.lines += 1
        row = done.reader.row(line)
        if row is not None:
            yield row


def _status(watch: Watcher, done: _Progress) -> dict[str, Any]:
    return watch.status() | {"malformed": done.reader.malformed}


def _emit(events: Sequence[dict[str, Any]], out: BinaryIO | None, done: _Progress) -> None:
    text = "".join(json.dumps(plain(event), allow_nan=False) + "\n" for event in events)
    sys.stdout.write(text)
    sys.stdout.flush()
    if out is None:
        return
    done.written += out.write(text.encode())
    out.flush()
    os.fsync(out.fileno())
    options().kept = "events so far are written"


def _save(watch: Watcher, done: _Progress, path: Path) -> None:
    try:
        watch.save(
            path,
            header=done.reader.header,
            malformed=done.reader.malformed,
            lines=done.lines,
            written=done.written,
        )
    except OSError as error:
        raise OutputError(str(path), f"cannot be written ({error.strerror})", "choose another --state") from error
    options().kept = f"{path} holds the state to go on from"
