"""Python files of a user's own, run as modules."""

import hashlib
import importlib.util
import sys
from pathlib import Path
from types import ModuleType


def executed(path: Path) -> ModuleType | None:
    """The module that the Python file at `path` makes, run once for each content; None where it is no Python file.

    The same text gives the same classes, so that programs compiled for them serve it when it is read again. It runs
    with the rights of the user. Whatever it raises is raised.
    """
    name = f"jaxsub_file_{hashlib.sha256(str(path).encode() + path.read_bytes()).hexdigest()[:16]}"
    if name not in sys.modules:
        spec = importlib.util.spec_from_file_location(name, path)
        if spec is None or spec.loader is None:
            return None
        # listed while it runs, since a class may look for its module there
        sys.modules[name] = module = importlib.util.module_from_spec(spec)
        try:
            spec.loader.exec_module(module)
        except BaseException:
            del sys.modules[name]
            raise
    return sys.modules[name]
