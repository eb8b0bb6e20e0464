"""What every command sets up: double precision and the compilation cache."""

import gc
import os
from pathlib import Path

import jax
import platformdirs

# up to a third less time, for programs that run as fast; on jax 0.10 half, for programs up to a quarter slower
_QUICKLY, _QUICKER = "--xla_backend_optimization_level=1", "--xla_cpu_use_fusion_emitters=false"


def start(long: bool = False) -> None:
    """Double precision, and compiled programs kept in the user's cache folder.

    Unless what follows is `long`, it is compiled quickly rather than well.
    """
    if not long:
        _compile_quickly()
    # tracing makes millions of short-lived objects, and collecting them at the default threshold costs seconds
    gc.set_threshold(200_000, 50, 50)
    jax.config.update("jax_enable_x64", True)
    folder = Path(platformdirs.user_cache_dir("jaxsub")) / f"jax-{jax.__version__}"
    jax.config.update("jax_compilation_cache_dir", str(folder))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)


def _compile_quickly() -> None:
    """Options of XLA, which reads them when it first compiles, and ends the process at one that it does not know.

    What the caller set is left as it is.
    """
    given = os.environ.get("XLA_FLAGS", "").split()
    known = [_QUICKLY, *([_QUICKER] if jax.__version_info__[:2] == (0, 10) else [])]
    fresh = [flag for flag in known if not any(one.startswith(flag.split("=")[0]) for one in given)]
    os.environ["XLA_FLAGS"] = " ".join([*given, *fresh])
