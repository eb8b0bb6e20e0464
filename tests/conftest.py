"""What every test starts from: 64-bit numbers, annotated shapes checked at each call, compiled code kept."""

from collections.abc import Iterator

import jax
import jaxtyping
import pytest
from hypothesis import settings

# the same examples at every run
settings.register_profile("seeded", derandomize=True, deadline=None)
settings.load_profile("seeded")
jax.config.update("jax_enable_x64", True)
# Most of the suite's time is compilation of programs that run once.
jax.config.update("jax_disable_most_optimizations", True)
# Before any test imports jaxsub, since only modules imported later are checked.
jaxtyping.install_import_hook("jaxsub", "typechecking.checked")


def pytest_configure(config: pytest.Config) -> None:
    if cache := getattr(config, "cache", None):
        jax.config.update("jax_compilation_cache_dir", str(cache.mkdir("jax")))
        jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)


@pytest.fixture(autouse=True)
def room_for_programs() -> Iterator[None]:
    """Compiled programs are let go of before there are too many."""
    from jaxsub.discrepancy.programs import make_room

    yield
    make_room()
