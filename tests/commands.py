"""How tests of several commands call them, in this process and in others."""

import os
from pathlib import Path

import jax

from jaxsub.cli import main


def ran(monkeypatch, capsys, *arguments):
    """The exit code of `jaxsub` with these arguments, and what it printed."""
    monkeypatch.setattr("sys.argv", ["jaxsub", *map(str, arguments)])
    try:
        main()
        code = 0
    except SystemExit as stop:
        code = stop.code
    return code, capsys.readouterr()


def environment(cache: Path | None = None, **more: str) -> dict[str, str]:
    """For processes of their own: they find this checkout, and commands keep their compiled programs in `cache`.

    By default that is a folder which stays from one run of the tests to the next.
    """
    root, shared = str(Path(__file__).parents[1]), jax.config.jax_compilation_cache_dir
    compiled = {"JAX_COMPILATION_CACHE_DIR": shared, "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0.3"}
    found = {"PYTHONPATH": root, "XDG_CACHE_HOME": str(cache or shared), "JAX_PLATFORMS": "cpu"}
    found["JAX_DISABLE_MOST_OPTIMIZATIONS"] = "1"
    return os.environ | found | (compiled if shared else {}) | more
