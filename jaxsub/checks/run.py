"""All checks of runs, in the order in which one's answer is another's ground."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from ..errors import InputError
from ..findings import Finding
from ..recording import Recording
from ..recording.recording import Recordings, listed
from ..vehicle import AbstractVehicle, Layout, vehicle_findings
from .channels import Channel, channels_of
from .consistency import consistency
from .duplicates import duplicates
from .excitation import idle_inputs
from .modes import modes
from .ranges import impossible, sample_interval
from .repeats import clipped, constant, slow_sensor, stuck
from .sampling import late_start, pieces
from .sentinels import sentinels
from .spans import of_run
from .spikes import spikes
from .turning import turning


@dataclasses.dataclass(frozen=True, repr=False)
class Checked:
    """What checks found in runs, and the runs as they will be used. It prints a line for each finding.

    **Fields**

    - `findings`: of all runs and of the vehicle, errors first.
    - `recordings`, `held_out`: masked, unwrapped and cut; each has the findings of its own in `findings`.
    """

    findings: tuple[Finding, ...]
    recordings: tuple[Recording, ...]
    held_out: tuple[Recording, ...] = ()

    def __repr__(self) -> str:
        lines = [f"{finding.severity}: {finding.line()}" for finding in self.findings]
        return "\n".join(lines) or f"Nothing was found in {len(self.recordings) + len(self.held_out)} recordings."

    @property
    def errors(self) -> tuple[Finding, ...]:
        """The findings that stop a command."""
        return tuple(finding for finding in self.findings if finding.severity == "error")


def check(vehicle: AbstractVehicle, recordings: Recordings, held_out: Recordings = ()) -> Checked:
    """Check one run or several before any fit: faults of clocks and sensors, contradictions among them, the vehicle.

    `recordings` are the runs that `vehicle` would be fitted to, one or several, and `held_out` the test runs. Nothing
    is raised for what is wrong: it is in the findings. Samples that cannot be are masked, angles unwrapped, and a run
    is cut where time has a hole while an input moved; each of these is a finding too.
    """
    recordings, held_out = listed(recordings), listed(held_out)
    layout = vehicle.layout
    every = [*recordings, *held_out]
    known = {name for recording in every for name in recording.columns}
    mended, found = [], [*vehicle_findings(vehicle, layout.name), *duplicates(recordings, held_out)]
    for recording in every:
        parts, findings = _run(recording, layout, known, vehicle.speed)
        mended.append(parts)
        found += findings
    if not any(finding.severity == "error" for finding in found):
        used = [part for parts in mended for part in parts]
        found += [*modes(vehicle, used), *idle_inputs(vehicle, used)]
    order = ("error", "warning", "note")
    ranked = sorted(found, key=lambda finding: order.index(finding.severity))
    flat = lambda groups: tuple(part for parts in groups for part in parts)
    count = len(recordings)
    return Checked(tuple(ranked), flat(mended[:count]), flat(mended[count:]))


def _run(recording: Recording, layout: Layout, known: set[str], speed: float) -> tuple[list[Recording], list[Finding]]:
    """One run as it will be used, in pieces, and what was found in it."""
    channels, body = channels_of(layout), layout.kind == "submerged-body"
    findings = list(recording.findings)
    absent = _columns(recording, channels, known)
    findings += absent
    if any(finding.severity == "error" for finding in absent):
        return [recording], findings
    findings += sample_interval(recording)
    columns = dict(recording.columns)
    for channel in channels:
        values = columns.get(channel.name, np.full(len(recording.times), np.nan))
        findings += constant(recording, channel, values)
        for mend in (sentinels, impossible, slow_sensor, stuck):
            values, more = mend(recording, channel, values)
            findings += more
        # a body's angles may have spikes before their turns are counted; a mechanism's show by their jumps alone
        for mend in (spikes, turning) if body else (turning, spikes):
            values, more = mend(recording, channel, values, body)
            findings += more
        findings += clipped(recording, channel, values)
        columns[channel.name] = values
    whole = dataclasses.replace(recording, columns=columns)
    findings += consistency(recording, layout, columns, speed)
    findings += [note for channel in channels if channel.role == "measured" for note in late_start(whole, channel)]
    parts, more = pieces(whole, [channel for channel in channels if channel.role != "measured"])
    findings += more
    return [dataclasses.replace(part, findings=tuple(findings)) for part in parts], findings


def _columns(recording: Recording, channels: Sequence[Channel], known: set[str]) -> list[Finding]:
    """An error for each column that is absent or cannot be used; a note for an output that only other runs have."""
    findings = []
    for channel in channels:
        absent = channel.name not in recording.columns and channel.name not in recording.unusable
        if absent and channel.role == "measured" and channel.name in known:
            what = "is not in this run, but in others: all its samples are taken as missing"
            findings.append(of_run("absent-output", "note", recording, channel.name, what))
            continue
        try:
            if channel.role == "measured":
                recording.column(channel.name)
            else:
                recording.inputs([channel.name])
        except InputError as error:
            findings.append(from_error("column", error))
    return findings


def from_error(check: str, error: InputError) -> Finding:
    """A finding of the `check` of that name that says what `error` says."""
    where, what, remedy = error.parts
    return Finding(check, "error", where, what, remedy)
