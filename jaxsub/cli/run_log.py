"""What a folder of results was made by: `run.json`, with the command's settings, its inputs and the versions."""

import os
import platform
import sys
import time
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import click

from ..plain import to_json
from ..storage import installed_version, size_and_digest

RUN_LOG = "run.json"
# what computes; a result may differ in its last digits by their versions
_LIBRARIES = ("jax", "jaxlib", "equinox", "optimistix", "diffrax", "numpy")
# variables that change what runs or where
_VARIABLES = ("JAX_PLATFORMS", "JAX_ENABLE_X64", "XLA_FLAGS", "JAXSUB_DATA")


def versions() -> dict[str, str]:
    """Versions of jaxsub, Python and the libraries that compute, by name."""
    own = {"jaxsub": installed_version("jaxsub"), "python": platform.python_version()}
    return own | {name: installed_version(name) for name in _LIBRARIES}


def device() -> str:
    """The kind of device that JAX computes on: `cpu`, or a GPU's name."""
    import jax

    return jax.devices()[0].device_kind


class RunLog:
    """The log of one command, which has begun now and reads the files `inputs`."""

    def __init__(self, inputs: Sequence[Path]):
        self._inputs, self._begin, self._clock = inputs, datetime.now(UTC), time.monotonic()

    def write(self, folder: Path) -> None:
        """Write `run.json` into `folder`."""
        (folder / RUN_LOG).write_text(to_json(self._said()), encoding="utf-8")

    def _said(self) -> dict[str, Any]:
        context = click.get_current_context(silent=True)
        return {
            "schema": 1,
            "command": context.info_name if context else None,
            "settings": {name: _plain(value) for name, value in context.params.items()} if context else {},
            "folder": str(Path.cwd()),
            "begin": self._begin.isoformat(timespec="seconds"),
            "seconds": round(time.monotonic() - self._clock, 1),
            "inputs": [_file(path) for path in self._inputs],
            "versions": versions(),
            # asked of JAX only where the command has used it
            "device": device() if "jax" in sys.modules else None,
            "environment": {name: os.environ[name] for name in _VARIABLES if name in os.environ},
        }


def _plain(value: Any) -> Any:
    """A setting as JSON has it."""
    if isinstance(value, tuple | list):
        return [_plain(part) for part in value]
    return str(value) if isinstance(value, Path) else value


def _file(path: Path) -> dict[str, Any]:
    """An input's size and digest, by which it is known again; of a folder its name alone."""
    return {"path": str(path), **(size_and_digest(path) if path.is_file() else {})}
