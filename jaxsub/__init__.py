"""Differentiable models of vehicles that move in water: fit recordings, name the physics a model lacks, show the gain.

`import jaxsub as js` offers what the lessons use. Vehicles are read with `read_vehicle`, recordings with `load`;
`simulate`, `fit`, `identifiability`, `diagnose` and `sweep` take a vehicle and one or several recordings. The rooms
of the package, such as `jaxsub.filter`, have the rest.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .api.diagnoses import Diagnosis, diagnose
    from .api.fits import Fit, fit, identifiability
    from .api.simulations import Simulation, simulate
    from .api.states import States, estimate_states
    from .api.sweeps import Sweep, sweep
    from .checks import check
    from .control import Mpc, Plant, discretise, linearise, trim
    from .effects import vocabulary
    from .errors import InputError
    from .information import Identifiability
    from .monitoring import Watcher
    from .recording import Recording, Selection, from_pandas, from_xarray, hold_out, load, save, split
    from .simulation import doublet, prbs, synthetic, three_two_one_one
    from .vehicle import Model, initial_file, own_model, read_vehicle, vehicle_from, vehicle_text, write_vehicle

    __version__: str

__all__ = [
    "Diagnosis",
    "Fit",
    "Identifiability",
    "InputError",
    "Model",
    "Mpc",
    "Plant",
    "Recording",
    "Selection",
    "Simulation",
    "States",
    "Sweep",
    "Watcher",
    "__version__",
    "check",
    "diagnose",
    "discretise",
    "doublet",
    "estimate_states",
    "fit",
    "from_pandas",
    "from_xarray",
    "hold_out",
    "identifiability",
    "initial_file",
    "linearise",
    "load",
    "own_model",
    "prbs",
    "read_vehicle",
    "save",
    "simulate",
    "split",
    "sweep",
    "synthetic",
    "three_two_one_one",
    "trim",
    "vehicle_from",
    "vehicle_text",
    "vocabulary",
    "write_vehicle",
]

# the module of each name; a test holds it to what the imports above say
_NAMES = {
    "api.diagnoses": "Diagnosis diagnose",
    "api.fits": "Fit fit identifiability",
    "api.simulations": "Simulation simulate",
    "api.states": "States estimate_states",
    "api.sweeps": "Sweep sweep",
    "checks": "check",
    "control": "Mpc Plant discretise linearise trim",
    "effects": "vocabulary",
    "errors": "InputError",
    "information": "Identifiability",
    "monitoring": "Watcher",
    "recording": "Recording Selection from_pandas from_xarray hold_out load save split",
    "simulation": "doublet prbs synthetic three_two_one_one",
    "vehicle": "Model initial_file own_model read_vehicle vehicle_from vehicle_text write_vehicle",
}
_MODULES = {name: module for module, names in _NAMES.items() for name in names.split()}


def __getattr__(name: str) -> Any:
    """A public name, imported at its first use: `import jaxsub` alone loads neither JAX nor a table."""
    if name == "__version__":
        from importlib.metadata import version

        found = version("jaxsub")
    elif name in _MODULES:
        found = getattr(importlib.import_module(f".{_MODULES[name]}", __name__), name)
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
