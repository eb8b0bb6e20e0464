"""Readers of damaged logs keep off the terminal; what they report is a warning or part of the one error."""

import struct
import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from file_examples import COLUMNS, WRITERS

from jaxsub.errors import InputError
from jaxsub.recording import contents, load

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
    reported = [f for found in findings for f in found if f.check == "incomplete-log"]
    assert reported and all(f.severity == "warning" for f in reported)
    assert any(words in f.what and "samples may be missing" in f.what for f in reported)


def test_sound_logs_have_no_such_warning(tmp_path):
    for kind in COLUMNS:
        WRITERS[kind](tmp_path / f"run.{kind}")
        path = tmp_path / f"run.{kind}"
        assert "incomplete-log" not in {
            f.check for f in (*load(path, COLUMNS[kind]).findings, *contents(path).findings)
        }


@pytest.mark.parametrize("kind", COLUMNS)
def test_a_log_that_is_cut_says_so_wherever_it_is_read(tmp_path, capfd, kind):
    """Claim: a log cut within a message is refused or is read with one warning, when loaded and when listed.

    Of two cuts a byte apart one at most falls between messages, which no reader can tell from a log's end.
    """
    path = tmp_path / f"run.{kind}"
    WRITERS[kind](path)
    whole, heard = path.read_bytes(), []
    for end in (len(whole) * np.array([0.3, 0.4, 0.5, 0.6, 0.7])).astype(int):
        heard.append([])
        for size in (end, end + 1):
            path.write_bytes(whole[:size])
            try:
                loaded = [f.line() for f in load(path, COLUMNS[kind]).findings if f.check == "incomplete-log"]
                assert loaded == [f.line() for f in contents(path).findings]
                heard[-1] += loaded
            except InputError as error:
                heard[-1].append(str(error))
    assert all(heard) and all(len(line.splitlines()) == 1 for lines in heard for line in lines)
    assert capfd.readouterr() == ("", "")


def test_of_a_cut_mcap_the_whole_chunks_are_read(tmp_path):
    path = WRITERS["mcap"](tmp_path / "run.mcap")
    whole = load(path, COLUMNS["mcap"])
    content = path.read_bytes()
    path.write_bytes(content[: 2 * len(content) // 3])
    part = load(path, COLUMNS["mcap"])
    rows = len(part.times)
    assert len(whole.times) / 2 < rows < len(whole.times)
    np.testing.assert_array_equal(part.column("r"), whole.column("r")[:rows])


def test_a_chunk_whose_checksum_fails_is_left_out(tmp_path):
    """Claim: a digit that changes within a message of JSON gives no wrong number."""
    path = WRITERS["mcap"](tmp_path / "run.mcap")
    content, whole = path.read_bytes(), load(path, COLUMNS["mcap"])
    at = content.index(b"zstd", len(content) // 3) + 40  # within the bytes of a chunk
    path.write_bytes(content[:at] + bytes([content[at] ^ 1]) + content[at + 1 :])
    part = load(path, COLUMNS["mcap"])
    assert "cannot be read" in next(f.what for f in part.findings if f.check == "incomplete-log")
    assert len(part.times) < len(whole.times)
    kept = np.isin(whole.times, part.times)
    np.testing.assert_array_equal(part.column("r"), whole.column("r")[kept])


def test_messages_that_a_logger_dropped_are_counted(tmp_path):
    path = WRITERS["ulg"](tmp_path / "run.ulg")
    path.write_bytes(path.read_bytes() + b"".join(struct.pack("<HBH", 2, ord("O"), ms) for ms in (30, 270)))
    (found,) = contents(path).findings
    assert "its logger dropped messages 2 times, 0.3 s in all" in found.what


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
