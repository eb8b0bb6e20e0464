"""`jaxsub watch` prints an event a line, also to a file where one is asked for, and counts what was wrong with rows."""

import json

import pytest
from commands import ran
from rigs import write_rig


@pytest.mark.parametrize("kept", [True, pytest.param(False, marks=pytest.mark.long)])
def test_events_are_printed_and_are_the_same_in_a_file(tmp_path, monkeypatch, capsys, kept):
    """Claim: at the end of a file with one line of words the status counts that line, and exit is 0, with --out too."""
    write_rig(tmp_path, samples=300)
    stream, events = tmp_path / "stream.csv", tmp_path / "events.jsonl"
    lines = (tmp_path / "run.csv").read_text().splitlines(keepends=True)
    stream.write_text("".join([*lines[:100], "half a line\n", *lines[100:]]))
    asked = ("watch", tmp_path / "vehicle.toml", stream, *(("--out", events) if kept else ()))
    code, shown = ran(monkeypatch, capsys, *asked)
    assert code in (0, None), shown.err
    last = json.loads(shown.out.splitlines()[-1])
    assert (last["event"], last["end"], last["malformed"], last["samples"]) == ("status", True, 1, 300)
    assert events.exists() == kept and (not kept or events.read_text() == shown.out)
