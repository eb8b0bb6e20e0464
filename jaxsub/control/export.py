"""A plant compiled ahead of time: one file with the programs, names and a loader that needs only JAX."""

import inspect
import json
import zipfile
from collections.abc import Callable, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import export
from jaxtyping import Array, Float

from ..errors import InputError
from ..simulate import at_rest
from . import plant_loader
from .plant import Plant

SCHEMA = 1


def export_plant(
    plant: Plant,
    path: Path,
    *,
    x: Float[Array, " s"] | None = None,
    u: Float[Array, " m"] | None = None,
    platforms: Sequence[str] = ("cpu", "cuda"),
) -> None:
    """Write `plant` to the file `path`: StableHLO of its step, outputs and Jacobians with the vehicle's numbers in it.

    The file is a zip archive: `plant.json` (names, `dt`, the vehicle's numbers, SI), each of `plant_loader.PROGRAMS` as
    `jax.export` serialises it, and `plant_loader.py`, by which a machine with JAX alone calls them, with the
    `flatbuffers` by which JAX reads them. It does so for at least six months after its version; step and outputs keep
    one derivative. `x` and `u` are a state and inputs to start from, such as a trim; by default at rest.

    **Raises** `InputError` where the folder of `path` is not there, or flatbuffers is not installed.
    """
    path = Path(path)
    if not path.parent.is_dir():
        raise InputError(str(path), "its folder is not there", "make it first")
    u = jnp.zeros(len(plant.inputs), plant.constants.dtype) if u is None else u
    x = plant.start(at_rest(plant.vehicle, 1)[0].astype(u.dtype), u) if x is None else x
    layout = plant.vehicle.layout
    about = {
        "schema": SCHEMA,
        "name": layout.name,
        "dt": plant.dt,
        "states": plant.states,
        "inputs": plant.inputs,
        "outputs": plant.outputs,
        "dtype": str(np.asarray(x).dtype),
        "start": np.asarray(x).tolist(),
        "trim": np.asarray(u).tolist(),
        "effects": [effect.label for effect in plant.vehicle.effects],
        "values": {name: float(value) for name, value in plant.vehicle.values().items()},
        "jax": jax.__version__,
        "platforms": list(platforms),
    }
    shapes = [jax.ShapeDtypeStruct(np.shape(part), x.dtype) for part in (x, u, 0.0)]
    brought = _flatbuffers()
    loader = inspect.getsource(plant_loader)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("plant.json", json.dumps(about, indent=1))
        for name, text in {"plant_loader.py": loader, **brought}.items():
            archive.writestr(name, text)
        for name, method in _programs(plant).items():
            program = export.export(jax.jit(method), platforms=list(platforms))(*shapes)
            archive.writestr(f"{name}.bin", bytes(program.serialize(vjp_order=0 if name == "jacobians" else 1)))


def _programs(plant: Plant) -> dict[str, Callable[[Array, Array, Array], Any]]:
    """What is exported; a loader does not know of the type that `jacobians` gives."""
    called = {name: getattr(plant, name) for name in plant_loader.PROGRAMS}
    # jit needs what it can hash, which the method of a module is not
    programs = {name: (lambda x, u, t, f=f: f(x, u, t)) for name, f in called.items()}
    return programs | {"jacobians": lambda x, u, t: tuple(plant.jacobians(x, u, t))}


def _flatbuffers() -> dict[str, str]:
    """The modules of flatbuffers, which is plain Python, by their names in the archive."""
    try:
        folder = resources.files("flatbuffers")
    except ModuleNotFoundError as error:
        raise InputError("flatbuffers", "is not installed", "pip install 'jaxsub[control]'") from error
    found = {f"flatbuffers/{part.name}": part for part in folder.iterdir() if part.name.endswith(".py")}
    return {name: part.read_text(encoding="utf-8") for name, part in found.items()}
