"""The class of a user's model, from the Python file that a vehicle file names."""

import inspect
import sys
from pathlib import Path

from ...effects.script import executed
from ...errors import InputError, suggestion
from .model import Model


def loaded(reference: str, folder: Path, place: str) -> type[Model]:
    """The class that `reference`, such as `tank.py:Tank`, names in `folder`; its file is run, once for each content.

    It runs with the rights of the user, who should know where a vehicle file with a class comes from. No other kind of
    vehicle file runs anything.

    **Raises** `InputError` for a file that there is not or that fails, and for what is no `Model` in it.
    """
    file, colon, name = reference.rpartition(":")
    if not colon:
        raise InputError(place, f"{reference!r:.60} names no class", 'write class = "tank.py:Tank"')
    path = (folder / file).resolve()
    if not path.is_file():
        raise InputError(place, f"{str(path)!r:.200} is no file", "give the path of a Python file from this one")
    try:
        module = executed(path)
    except Exception as error:
        raise InputError(place, f"{path.name} fails: {error!r:.200}", "run it by Python and mend it") from error
    if module is None:
        raise InputError(place, f"{str(path)!r:.200} is no Python file", "give one that ends in .py")
    kinds = [key for key, value in vars(module).items() if isinstance(value, type) and issubclass(value, Model)]
    if name not in kinds:
        own = [kind for kind in kinds if kind != "Model"]
        remedy = suggestion(name, own, f"it has {', '.join(own) or 'no subclass of jaxsub.Model'}")
        raise InputError(place, f"{path.name} has no model {name}", remedy)
    return getattr(module, name)


def source_of(kind: type[Model]) -> str:
    """What a vehicle file may name the class by; its own name alone where it is in no file."""
    try:
        file = inspect.getsourcefile(sys.modules.get(kind.__module__, kind)) or ""
    except TypeError:
        file = ""
    return f"{file}:{kind.__qualname__}" if Path(file).is_file() else kind.__qualname__
