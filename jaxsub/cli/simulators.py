"""`jaxsub import` and `jaxsub export`: vehicles from and to the files of simulators."""

from pathlib import Path

from ..errors import InputError
from ..vehicle import SubmergedBody, read_mss, read_sdf, read_vehicle, sdf_text, vehicle_text
from . import session, terminal
from .output import fresh_file


def run_import(path: Path, out: Path, overwrite: bool) -> None:
    """Write the vehicle of the SDF or MATLAB file at `path` to `out`, and name what of the model it lacks."""
    session.start()
    with fresh_file(out, overwrite, [path]) as new:
        vehicle, lost = (read_mss if path.suffix == ".mat" else read_sdf)(path)
        said = [f"From {path.name}, by jaxsub import.", *(f"Not translated: {one}." for one in lost)]
        new.write_text(vehicle_text(vehicle, "\n".join(said)), encoding="utf-8")
    _emit(out, lost)


def run_export(path: Path, out: Path, overwrite: bool) -> None:
    """Write the vehicle at `path` to `out` as a model of Gazebo, and name what of the vehicle it lacks."""
    session.start()
    with fresh_file(out, overwrite, [path]) as new:
        vehicle = read_vehicle(path)
        if not isinstance(vehicle, SubmergedBody):
            raise InputError(str(path), "is a mechanism", 'Gazebo\'s hydrodynamics take kind = "submerged-body"')
        text, lost = sdf_text(vehicle)
        new.write_text(text, encoding="utf-8")
    _emit(out, lost)


def _emit(out: Path, lost: list[str]) -> None:
    lines = [f"{out}: {'not translated are' if lost else 'all is translated'}", *(f"  {one}" for one in lost)]
    terminal.emit({"schema": 1, "out": out, "not_translated": lost}, lambda: terminal.say("\n".join(lines)))
