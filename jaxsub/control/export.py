"""A plant compiled ahead of time: a file of programs, names and numbers, and beside it a loader that needs only JAX."""

import importlib.util
import inspect
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import export
from jaxtyping import Array, Float

from ..errors import InputError
from ..plain import to_json
from ..simulation import at_rest
from ..storage import written_whole
from . import plant_loader
from .plant import Plant


def export_plant(
    plant: Plant,
    path: Path,
    *,
    x: Float[Array, " s"] | None = None,
    u: Float[Array, " m"] | None = None,
    platforms: Sequence[str] = ("cpu", "cuda"),
) -> None:
    """Write `plant` to the file `path`: StableHLO of its step, outputs and Jacobians with the vehicle's numbers in it.

    The file is a zip archive of data alone: `plant.json` (names, `dt`, the vehicle's numbers, SI) and each of
    `plant_loader.PROGRAMS` as `jax.export` serialises it, for the `platforms` named as JAX does. `load_plant` reads it,
    for at least six months after its version; a machine without jaxsub does so by JAX, flatbuffers and the file that
    `export_plant_loader` writes. Step and outputs keep one derivative. `x` (s,) and `u` (m,) are a state and inputs,
    SI, to start from, such as a trim; by default at rest.

    **Raises** `InputError` where the folder of `path` is not there, flatbuffers is not installed, or a number of `x` or
    `u` is not finite.
    """
    path = Path(path)
    if not path.parent.is_dir():
        raise InputError(str(path), "its folder is not there", "make it first")
    u = jnp.zeros(len(plant.inputs), plant.constants.dtype) if u is None else u
    x = plant.start(at_rest(plant.vehicle, 1)[0].astype(u.dtype), u) if x is None else x
    if importlib.util.find_spec("flatbuffers") is None:
        raise InputError("flatbuffers", "is not installed", "pip install 'jaxsub[control]'")
    if not bool(jnp.all(jnp.isfinite(x)) & jnp.all(jnp.isfinite(u))):
        raise InputError("plant", "a number of the state or of the inputs to start from is not finite", "give others")
    layout = plant.vehicle.layout
    about = {
        "schema": plant_loader.SCHEMA,
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
    with written_whole(path) as unfinished, zipfile.ZipFile(unfinished, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("plant.json", to_json(about))
        for name, method in _programs(plant).items():
            program = export.export(jax.jit(method), platforms=list(platforms))(*shapes)
            archive.writestr(f"{name}.bin", bytes(program.serialize(vjp_order=0 if name == "jacobians" else 1)))


def export_plant_loader(path: Path) -> None:
    """Write to `path` the module that loads plants where there is no jaxsub, such as `plant_loader.py` beside them.

    There, `from plant_loader import load` and `load("my.plant")`; it needs JAX and flatbuffers.

    **Raises** `InputError` for a file that is there and is another.
    """
    path, source = Path(path), inspect.getsource(plant_loader)
    first = source.partition("\n")[0]
    if path.exists() and not (path.is_file() and path.read_bytes().startswith(first.encode())):
        raise InputError(str(path), "is there, and is no loader of plants", "give another path")
    with written_whole(path) as unfinished:
        unfinished.write_text(source, encoding="utf-8")


def load_plant(path: Path) -> SimpleNamespace:
    """The plant in the file `path`, as `plant_loader.load` gives it.

    **Raises** `InputError` for a file that is no plant, was damaged or brings code; and where flatbuffers is missing.
    """
    try:
        return plant_loader.load(path)
    except plant_loader.PlantError as error:
        raise InputError(*error.parts) from None
    except ModuleNotFoundError as error:
        raise InputError("flatbuffers", "is not installed", "pip install 'jaxsub[control]'") from error


def _programs(plant: Plant) -> dict[str, Callable[[Array, Array, Array], Any]]:
    """What is exported; a loader does not know of the type that `jacobians` gives."""
    called = {name: getattr(plant, name) for name in plant_loader.PROGRAMS}
    # jit needs what it can hash, which the method of a module is not
    programs = {name: (lambda x, u, t, f=f: f(x, u, t)) for name, f in called.items()}
    return programs | {"jacobians": lambda x, u, t: tuple(plant.jacobians(x, u, t))}
