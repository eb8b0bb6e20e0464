"""`jaxsub watch` prints an event a line, also to a file where one is asked for, and counts what was wrong with rows."""

import json

from commands import ran
from rigs import write_rig


def test_events_are_printed_without_a_file_and_are_the_same_in_one(tmp_path, monkeypatch, capsys):
    """Claim: at the end of a file with one line of words the status counts that line, and exit is 0, with --out too."""
    write_rig(tmp_path, samples=300)
    stream = tmp_path / "stream.csv"
    lines = (tmp_path / "run.csv").read_text().splitlines(keepends=True)
    stream.write_text("".join([*lines[:100], "half a line\n", *lines[100:]]))
    asked = ("watch", tmp_path / "vehicle.toml", stream)
    code, shown = ran(monkeypatch, capsys, *asked)
    assert code in (0, None), shown.err
    last = json.loads(shown.out.splitlines()[-1])
    assert (last["event"], last["end"], last["malformed"], last["samples"]) == ("status", True, 1, 300)
    code, again = ran(monkeypatch, capsys, *asked, "--out", tmp_path / "events.jsonl")
    assert code in (0, None), again.err
    assert (tmp_path / "events.jsonl").read_text() == again.out == shown.out
