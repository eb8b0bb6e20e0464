"""A plant file is written whole, holds data alone, and the loader beside it needs JAX and flatbuffers."""

import subprocess
import sys
import zipfile

import jax.numpy as jnp
import pytest

from jaxsub.control import discretise, export_plant, export_plant_loader, load_plant, plant_loader
from jaxsub.errors import InputError
from jaxsub.vehicle.catalogue import nps_auv_ii


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("plant") / "nps.plant"
    export_plant(discretise(nps_auv_ii(), 0.2), path)
    return path


def test_plant_file_holds_data_alone(path):
    with zipfile.ZipFile(path) as archive:
        assert tuple(archive.namelist()) == plant_loader.MEMBERS
    assert [other.name for other in path.parent.iterdir()] == [path.name]


def test_loading_changes_no_path(path):
    before = list(sys.path)
    load_plant(path)
    assert sys.path == before


def test_loader_without_flatbuffers_says_so_in_a_line(path, tmp_path):
    export_plant_loader(tmp_path / "plant_loader.py")
    program = f"""
import sys
sys.path.insert(0, {str(tmp_path)!r})
import importlib.util
of = importlib.util.find_spec
importlib.util.find_spec = lambda name, *more: None if name == "flatbuffers" else of(name, *more)
from plant_loader import load
try:
    load({str(path)!r})
except ModuleNotFoundError as error:
    print(error)
"""
    done = subprocess.run([sys.executable, "-I", "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.endswith("which is not installed; pip install flatbuffers\n")
    assert done.stdout.count("\n") == 1


def test_interrupted_export_leaves_the_plant_that_was_there(path, monkeypatch):
    before = path.read_bytes()

    def interrupted(*arguments, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr("jaxsub.control.export.export.export", interrupted)
    with pytest.raises(KeyboardInterrupt):
        export_plant(discretise(nps_auv_ii(), 0.2), path)
    assert path.read_bytes() == before
    assert [other.name for other in path.parent.iterdir()] == [path.name]


def test_loader_is_written_over_a_loader_only(tmp_path):
    path = tmp_path / "plant_loader.py"
    export_plant_loader(path)
    export_plant_loader(path)
    path.write_text("print('mine')\n")
    with pytest.raises(InputError, match=r"is there, and is no loader of plants; give another path$"):
        export_plant_loader(path)
    assert path.read_text() == "print('mine')\n"


def test_start_that_is_not_finite_is_not_exported(tmp_path):
    plant = discretise(nps_auv_ii(), 0.2)
    with pytest.raises(InputError, match=r"^plant: a number of the state or of the inputs .* is not finite"):
        export_plant(plant, tmp_path / "nps.plant", x=jnp.full(len(plant.states), jnp.nan))
    assert list(tmp_path.iterdir()) == []
