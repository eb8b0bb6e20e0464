"""What every test starts from: 64-bit numbers, annotated shapes checked at each call, compiled code kept."""

import contextlib
import gc
import importlib
import os
import warnings
from collections.abc import Iterator

import jax
import pytest
import typechecking
from hypothesis import settings

# the same examples at every run
settings.register_profile("seeded", derandomize=True, deadline=None)
settings.load_profile("seeded")
jax.config.update("jax_enable_x64", True)
# Most of the suite's time is compilation of programs that run once.
jax.config.update("jax_disable_most_optimizations", True)
# as in the commands: tracing makes millions of objects, and collecting them often takes a twentieth of the time
gc.set_threshold(200_000, 50, 50)
# jax 0.10 compiles in half the time without the first, and programs this small are not worth being split among threads;
# later ones end the process at a flag that they do not know
if jax.__version_info__[:2] == (0, 10):
    quick = "--xla_cpu_use_fusion_emitters=false --xla_cpu_parallel_codegen_split_count=1"
    os.environ["XLA_FLAGS"] = f"{os.environ.get('XLA_FLAGS', '')} {quick}"
# Before any test imports jaxsub, since only modules imported later are checked.
typechecking.install("jaxsub")

# the programs that were compiled, or read from the cache, since there was last made room for more
_compiled: list[str] = []


def pytest_configure(config: pytest.Config) -> None:
    if cache := getattr(config, "cache", None):
        jax.config.update("jax_compilation_cache_dir", str(cache.mkdir("jax")))
        jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    jax.monitoring.register_event_duration_secs_listener(_note_program)
    if not hasattr(config, "workerinput"):
        _date_arviz()


def _note_program(event: str, *_: float, **__: str) -> None:
    if event.endswith("backend_compile_duration"):
        _compiled.append(event)


def _date_arviz() -> None:
    """arviz dates the warning of its first import of a day, and two workers at once fail at that: it is dated here."""
    with warnings.catch_warnings(), contextlib.suppress(ImportError):
        warnings.simplefilter("ignore", FutureWarning)
        importlib.import_module("arviz")


@pytest.fixture(autouse=True)
def room_for_programs() -> Iterator[None]:
    """Compiled programs are let go of before there are too many, which is asked only where a test has made one.

    To count them takes up to 30 ms, and most of the thousands of tests make none.
    """
    from jaxsub.discrepancy.programs import make_room
    from jaxsub.programs import keep_programs

    yield
    # a command run in this process keeps them, but in later tests something of what they are made of may be replaced
    keep_programs(None)
    if _compiled:
        _compiled.clear()
        make_room()
