"""A full disk and one that cannot be written: the verdict is shown, the path is named, what was there stays."""

import shutil
import subprocess

import numpy as np
import pytest
from rigs import write_rig
from trees import tree

from jaxsub.cli import main
from jaxsub.cli.output import fresh_file, fresh_folder
from jaxsub.errors import InputError, OutputError
from jaxsub.recording import Recording, save


def mounted(folder, *options):
    """Whether `folder` could be mounted, or mounted again, with `options`."""
    if not shutil.which("mount"):
        return False
    command = ["mount", "-t", "tmpfs", "-o", ",".join(options), "jaxsub-test", str(folder)]
    return subprocess.run(command, capture_output=True, check=False).returncode == 0


@pytest.fixture
def disk(tmp_path):
    """A disk of 64 KiB."""
    folder = tmp_path / "disk"
    folder.mkdir()
    if not mounted(folder, "size=64k"):
        pytest.skip("this user may not mount a small disk")
    yield folder
    subprocess.run(["umount", "-l", str(folder)], check=True)


@pytest.fixture
def rig(tmp_path):
    """A vehicle file and a recording of it."""
    write_rig(tmp_path)
    return [str(tmp_path / "vehicle.toml"), str(tmp_path / "run.csv")]


def filled(disk):
    with pytest.raises(OSError, match="space"), (disk / "ballast").open("wb", buffering=0) as file:
        while True:
            file.write(bytes(4096))
    return tree(disk)


def long_run():
    t = 0.1 * np.arange(5000)
    return Recording("long", t, {"x": np.sin(t)}, "test")


@pytest.mark.parametrize("name", ["a.csv", "a.parquet", "a.nc"])
def test_recording_that_does_not_fit_is_one_error_and_leaves_nothing(disk, capfd, name):
    before = tree(disk)
    with pytest.raises(OutputError, match=rf"{name}: cannot be written \(.*[Nn]o space left on device"):
        save(long_run(), disk / name)
    assert tree(disk) == before
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("name", ["a.csv", "a.parquet", "a.nc", "a.txt"])
def test_result_that_does_not_fit_leaves_the_old_one(disk, name):
    with fresh_folder(disk / "out", False) as folder:
        (folder / "a.txt").write_text("old")
    before = tree(disk)
    with pytest.raises(OutputError) as caught, fresh_folder(disk / "out", True) as folder:
        if name == "a.txt":
            (folder / name).write_bytes(bytes(100_000))
        else:
            save(long_run(), folder / name)
    assert f"{disk / 'out'}" in str(caught.value) and ".jaxsub-" not in str(caught.value)
    assert "o space left on device" in str(caught.value)
    assert tree(disk) == before


def test_file_that_does_not_fit_leaves_the_old_one(disk):
    with fresh_file(disk / "a.csv", False) as path:
        path.write_text("old")
    before = tree(disk)
    with pytest.raises(OutputError, match=r"a\.csv: cannot be written"), fresh_file(disk / "a.csv", True) as path:
        path.write_bytes(bytes(100_000))
    assert tree(disk) == before


def ran(monkeypatch, capfd, *arguments):
    monkeypatch.setattr("sys.argv", ["jaxsub", *map(str, arguments)])
    with pytest.raises(SystemExit) as stop:
        main()
    return stop.value.code, capfd.readouterr()


@pytest.mark.parametrize(("command", "out", "word"), [("identify", "out", "K_x"), ("simulate", "out.nc", "rms/σ")])
def test_command_on_a_full_disk_shows_its_verdict_and_names_the_path(disk, rig, monkeypatch, capfd, command, out, word):
    before = filled(disk)
    code, said = ran(monkeypatch, capfd, command, *rig, "--out", disk / out)
    assert code == 1 and word in said.out
    last = said.err.strip().splitlines()[-1]
    assert last.startswith(f"jaxsub: {disk / out}") and "cannot be written" in last, said.err
    assert "HDF5" not in said.err and "Traceback" not in said.err and ".jaxsub-" not in last
    assert tree(disk) == before


def test_sweep_on_a_full_disk_names_the_path_and_keeps_what_is_done(disk, rig, monkeypatch, capfd):
    filled(disk)
    code, said = ran(monkeypatch, capfd, "sweep", *rig, "--starts", "3", "--out", disk / "out")
    assert code == 1 and f"{disk / 'out'}" in said.err.strip().splitlines()[-1]
    assert "cannot be written" in said.err and "HDF5" not in said.err
    assert not list(disk.rglob(".jaxsub-*"))


@pytest.mark.parametrize(("command", "out"), [("identify", "out"), ("simulate", "out.nc"), ("sweep", "out")])
def test_command_on_a_disk_that_is_read_only_is_refused_before_the_work(disk, rig, monkeypatch, capfd, command, out):
    (disk / "mine").write_text("mine")
    assert mounted(disk, "remount", "ro")
    before = tree(disk)
    options = ["--starts", "3"] if command == "sweep" else []
    code, said = ran(monkeypatch, capfd, command, *rig, "--out", disk / out, *options)
    assert code == 2 and said.out == "" and said.err.count("\n") == 1
    assert "cannot be written" in said.err
    assert tree(disk) == before


def test_folder_that_may_not_be_written_is_refused(disk):
    assert mounted(disk, "remount", "ro")
    with pytest.raises(InputError, match="cannot be written"), fresh_folder(disk / "deep" / "out", False):
        pass


def test_input_given_as_out_keeps_it(tmp_path, rig, monkeypatch, capfd):
    before = tree(tmp_path)
    for command in ("identify", "diagnose", "simulate", "sweep"):
        for out in (*rig, tmp_path):
            options = ["--starts", "3"] if command == "sweep" else []
            code, said = ran(monkeypatch, capfd, command, *rig, "--out", out, "--overwrite", *options)
            assert code == 2 and said.err.count("\n") == 1 and str(out) in said.err
    assert tree(tmp_path) == before
