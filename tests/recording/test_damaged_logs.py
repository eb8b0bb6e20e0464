"""Readers of damaged logs keep off the terminal; what they report is a warning or part of the one error."""

import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from file_examples import COLUMNS, WRITERS

from jaxsub.errors import InputError
from jaxsub.recording import load

for package in ("pyulog", "mcap", "rosbags", "pymavlink"):
    pytest.importorskip(package)
DAMAGES = 20


def damaged(whole, rng):
    """The bytes with fifty in a row, somewhere behind the head, drawn anew."""
    content = bytearray(whole)
    at = int(rng.integers(len(content) // 4, len(content) - 50))
    content[at : at + 50] = rng.integers(0, 256, 50, dtype=np.uint8).tobytes()
    return bytes(content)


def outcomes(path, kind):
    """The findings of each damaged copy of the log that is read, and the errors of the others."""
    rng = np.random.default_rng(5)
    WRITERS[kind](path)
    whole, findings, errors = path.read_bytes(), [], []
    for _ in range(DAMAGES):
        path.write_bytes(damaged(whole, rng))
        try:
            findings.append(load(path, COLUMNS[kind]).findings)
        except InputError as error:
            errors.append(str(error))
    return findings, errors


@pytest.mark.parametrize("kind", COLUMNS)
def test_nothing_is_printed_and_errors_are_one_line(tmp_path, capfd, kind):
    findings, errors = outcomes(tmp_path / f"run.{kind}", kind)
    assert capfd.readouterr() == ("", "")
    assert len(findings) + len(errors) == DAMAGES
    assert all(len(line.splitlines()) == 1 for line in errors)


@pytest.mark.parametrize(("kind", "words"), [("ulg", "message id"), ("bin", "bad")])
def test_damage_that_a_reader_reports_is_a_warning(tmp_path, kind, words):
    """Claim: some of the logs are read in part, and each of those says so."""
    findings, _ = outcomes(tmp_path / f"run.{kind}", kind)
    reported = [f for found in findings for f in found if f.check == "damaged-log"]
    assert reported and all(f.severity == "warning" for f in reported)
    assert any(words in f.what and "samples there are missing" in f.what for f in reported)


def test_sound_logs_have_no_such_warning(tmp_path):
    for kind in COLUMNS:
        WRITERS[kind](tmp_path / f"run.{kind}")
        assert "damaged-log" not in {f.check for f in load(tmp_path / f"run.{kind}", COLUMNS[kind]).findings}


def test_threads_that_read_logs_leave_the_streams_as_they_were(tmp_path):
    paths = [tmp_path / f"run{i}.ulg" for i in range(6)]
    for path in paths:
        WRITERS["ulg"](path)
        path.write_bytes(damaged(path.read_bytes(), np.random.default_rng(5)))
    streams = sys.stdout, sys.stderr
    with ThreadPoolExecutor(6) as pool:
        runs = list(pool.map(lambda path: load(path, COLUMNS["ulg"]), paths))
    assert (sys.stdout, sys.stderr) == streams
    assert len({tuple(f.what for f in run.findings) for run in runs}) == 1
