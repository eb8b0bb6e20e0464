"""Functions of parts of the recordings, called on the cores of this machine or on the workers of a Dask cluster.

On a cluster each call is a task that has all it needs. A worker that dies loses nothing but time: Dask gives the calls
that it was at to another.
"""

import functools
import logging
import pickle
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib import metadata
from pathlib import Path
from typing import Any, TypeVar

import jax

from .errors import InputError
from .programs import keep_programs, kept_programs, on_cores

R = TypeVar("R")
# what gives the arguments of a call, when it is made
Given = Callable[[], tuple]

LOCAL = "local"
_PATIENCE = "5s"
# settings of this process that every worker takes over, and those that one on the same machine can
_SAME = ("jax_enable_x64",)
_CACHE = (
    "jax_compilation_cache_dir",
    "jax_persistent_cache_min_compile_time_secs",
    "jax_persistent_cache_min_entry_size_bytes",
)
# what numbers depend on besides what they are computed from
_PACKAGES = ("jaxsub", "jax", "equinox", "optimistix")


class _Cluster:
    """What gives calls to the workers of a cluster: nothing until `working_on` says so."""

    called: Callable[[Callable, Sequence[Given]], list] | None = None


def on_workers(function: Callable[..., R], arguments: Sequence[Given]) -> list[R]:
    """`function` of each of the `arguments`, in order: on the cluster of `working_on`, else on the cores here.

    A cluster finds the function by its name.
    """
    if _Cluster.called is None or len(arguments) == 1:
        return on_cores(lambda given: function(*given()), [(given,) for given in arguments])
    return _Cluster.called(function, arguments)


@contextmanager
def working_on(address: str | None) -> Iterator[None]:
    """Meanwhile `on_workers` calls on the cluster at `address`, or on one that is started here for `local`.

    **Raises** `InputError` where there is no `distributed`, or no scheduler at `address`. Within, a call that four
    workers died of raises `distributed.KilledWorker`.
    """
    if address is None:
        yield
        return
    here = address == LOCAL
    ready = tuple(settings_for(address).items()), kept_programs() if here else None, tuple(versions().items())
    with connected(address) as client:

        def called(function: Callable[..., R], arguments: Sequence[Given]) -> list[R]:
            # packed here: a worker could not unpack double precision before it has the settings
            tasks = [client.submit(_there, ready, pickle.dumps((function, given())), pure=False) for given in arguments]
            return [pickle.loads(answer) for answer in client.gather(tasks)]

        _Cluster.called = called
        try:
            yield
        finally:
            _Cluster.called = None


def settings_for(address: str) -> dict[str, Any]:
    """The settings of JAX here that workers at `address` take over."""
    names = (*_SAME, *_CACHE) if address == LOCAL else _SAME
    return {name: getattr(jax.config, name) for name in names}


def _there(ready: tuple, packed: bytes) -> bytes:
    """The task of a worker: a packed function of packed arguments, and its packed answer."""
    _prepare(*ready)
    function, given = pickle.loads(packed)
    return pickle.dumps(function(*given))


@functools.cache
def _prepare(settings: tuple, folder: Path | None, wanted: tuple) -> None:
    """Set a worker to the precision and cache of the process that asks. Raises `RuntimeError` for other versions."""
    if (found := tuple(versions().items())) != wanted:
        raise RuntimeError(f"the diagnosis has {dict(wanted)} and this worker {dict(found)}: install the same")
    for name, value in settings:
        jax.config.update(name, value)
    keep_programs(folder)


def versions() -> dict[str, str]:
    """Of the packages that answers depend on, here."""
    return {package: _version(package) for package in _PACKAGES}


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:  # a checkout on the path that nobody installed
        return "not installed"


def require_cluster(address: str) -> None:
    """Raise `InputError` where there is no `distributed`, or no scheduler at `address`."""
    distributed()
    if address != LOCAL:
        with connected(address):
            pass


def distributed() -> Any:
    """The package, or `InputError` where it is not installed."""
    try:
        import distributed
    except ImportError as error:
        raise InputError("--cluster", "needs Dask", "pip install 'jaxsub[cluster]'") from error
    return distributed


@contextmanager
def connected(address: str) -> Iterator[Any]:
    """A client of the scheduler at `address`, or of a cluster that is started here for `local`."""
    found = distributed()
    if address == LOCAL:
        settings = {"threads_per_worker": 1, "dashboard_address": None, "silence_logs": logging.ERROR}
        with (
            found.LocalCluster(processes=True, **settings) as cluster,
            found.Client(cluster, set_as_default=False) as client,
        ):
            yield client
        return
    try:
        # a default client would take over whatever this program computes by Dask, and stays so where it finds nobody
        client = found.Client(address, timeout=_PATIENCE, set_as_default=False)
    except (OSError, ValueError, LookupError, TypeError) as error:
        remedy = "give the address of a Dask scheduler, such as tcp://10.0.0.1:8786, or local"
        raise InputError(f"--cluster {address}", "no scheduler answers there", remedy) from error
    with client:
        yield client
