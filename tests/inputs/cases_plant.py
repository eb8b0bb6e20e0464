"""Exported plants: each is read as it was written, or refused before anything that it brings is run or unpacked."""

import functools
import json
import tempfile
import warnings
import zipfile
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from corpus import Case
from jax import export

from jaxsub.control import discretise, export_plant, load_plant
from jaxsub.vehicle.catalogue import nps_auv_ii

_RAN = Path(tempfile.gettempdir()) / "jaxsub-plant-ran"
_CODE = f"open({str(_RAN)!r}, 'w').write('ran')\n"


@functools.cache
def _whole() -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "nps.plant"
        export_plant(discretise(nps_auv_ii(), 0.2), path)
        return path.read_bytes()


def _members() -> dict[str, bytes]:
    with tempfile.TemporaryFile() as file:
        file.write(_whole())
        with zipfile.ZipFile(file) as archive:
            return {name: archive.read(name) for name in archive.namelist()}


def _load(folder: Path, members: dict[str, bytes], method: int = zipfile.ZIP_DEFLATED):
    path = folder / "my.plant"
    with zipfile.ZipFile(path, "w", method) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return load_plant(path)


def _bytes(content: bytes | None = None, change=lambda content: content):
    def make(folder: Path):
        path = folder / "my.plant"
        path.write_bytes(change(_whole() if content is None else content))
        return load_plant(path)

    return make


def _with(method: int = zipfile.ZIP_DEFLATED, **changed):
    """The members, `dot`ted names by `_`, changed: None leaves one out."""

    def make(folder: Path):
        members = _members()
        for name, content in changed.items():
            members[name.replace("_dot_", ".").replace("_slash_", "/")] = content
        return _load(folder, {name: content for name, content in members.items() if content is not None}, method)

    return make


def _about(text: str | None = None, **changed):
    def make(folder: Path):
        members = _members()
        about = json.loads(members["plant.json"]) | changed
        about = {key: value for key, value in about.items() if value is not ...}
        return _load(folder, members | {"plant.json": (json.dumps(about) if text is None else text).encode()})

    return make


def _not_run(make):
    def checked(folder: Path):
        _RAN.unlink(missing_ok=True)
        try:
            return make(folder)
        finally:
            assert not _RAN.exists(), "code of the plant was run"

    return checked


def _garbled(content: bytes) -> bytes:
    spoilt = bytearray(content)
    for at in range(100, len(spoilt), 251):
        spoilt[at] ^= 0x5A
    return bytes(spoilt)


def _other_program(step, *sizes):
    """As the step of the plant, a program that was made elsewhere."""

    def make(folder: Path):
        like = [jax.ShapeDtypeStruct(size, jnp.float64) for size in sizes]
        allowed = [export.DisabledSafetyCheck.custom_call("their_kernel")]
        program = export.export(jax.jit(step), platforms=["cpu"], disabled_checks=allowed)(*like)
        return _load(folder, _members() | {"step.bin": bytes(program.serialize())})

    return make


def _foreign_call(x, u, t):
    return jax.ffi.ffi_call("their_kernel", jax.ShapeDtypeStruct(x.shape, x.dtype))(x)


def _solving(x, u, t):
    """Uses LAPACK, which is JAX's own."""
    return jnp.linalg.solve(jnp.eye(10) + x[:, None] * x, x)


def _is_the_plant(plant) -> None:
    own = discretise(nps_auv_ii(), 0.2)
    u = np.array([0.1, 0.0, -0.1])
    assert plant.states == own.states and plant.inputs == own.inputs
    np.testing.assert_allclose(plant.step(plant.start, u), own.step(plant.start, jnp.asarray(u)), atol=1e-12)


def _steps(plant) -> None:
    x = np.asarray(plant.start)
    np.testing.assert_allclose(plant.step(x, np.zeros(3)), np.linalg.solve(np.eye(10) + np.outer(x, x), x), atol=1e-12)


def _folder(folder: Path):
    (folder / "my.plant").mkdir()
    return load_plant(folder / "my.plant")


def _twice(folder: Path):
    members = _members()
    path = folder / "my.plant"
    with zipfile.ZipFile(path, "w") as archive, warnings.catch_warnings(action="ignore"):
        for name, content in (*members.items(), ("plant.json", members["plant.json"])):
            archive.writestr(name, content)
    return load_plant(path)


def _refused(name: str, make, *words: str) -> Case:
    return Case(f"plant: {name}", _not_run(make), refused=("my.plant", *words))


_DEEP = '{"schema": 2, "name": ' + "[" * 100_000 + "]" * 100_000 + "}"
_CHANGED = {key: _about(**{key: ...}) for key in ("name", "dt", "dtype", "states", "start", "trim", "values")}

CASES = [
    Case("plant: as it was written", _bytes(), check=_is_the_plant),
    Case("plant: packed without compression", _with(zipfile.ZIP_STORED), check=_is_the_plant),
    Case("plant: program that uses LAPACK", _other_program(_solving, (10,), (3,), ()), check=_steps),
    _refused("absent", lambda folder: load_plant(folder / "my.plant"), "is no file"),
    _refused("folder", _folder, "is no file"),
    _refused("empty file", _bytes(b""), "is no exported plant"),
    _refused("text", _bytes(b"[body]\nmass = 3\n"), "is no exported plant"),
    _refused("truncated to a half", _bytes(change=lambda c: c[: len(c) // 2]), "is no exported plant"),
    _refused("last byte lost", _bytes(change=lambda c: c[:-1]), "is no exported plant"),
    _refused("garbled", _bytes(change=_garbled), "export it again"),
    _refused("flatbuffers inside", _with(flatbuffers_slash___init___dot_py=_CODE.encode()), "__init__.py", "holds"),
    _refused("loader inside", _with(plant_loader_dot_py=_CODE.encode()), "plant_loader.py", "holds"),
    _refused("jax inside", _with(jax_dot_py=_CODE.encode()), "jax.py"),
    _refused("path that leads outside", _with(**{"../evil": b""}), "../evil"),
    _refused("program missing", _with(output_dot_bin=None), "does not hold each"),
    _refused("member twice", _twice, "does not hold each"),
    _refused("bomb in a program", _with(step_dot_bin=bytes(2**27)), "bytes unpacked"),
    _refused("bomb in the names", _with(plant_dot_json=b" " * 2**27), "bytes unpacked"),
    _refused("packed by lzma", _with(zipfile.ZIP_LZMA), "another method"),
    _refused("program of zeros", _with(step_dot_bin=bytes(5000)), "step.bin", "is no program"),
    _refused("program empty", _with(step_dot_bin=b""), "step.bin", "is no program"),
    _refused("programs exchanged", lambda f: _load(f, (m := _members()) | {"step.bin": m["jacobians.bin"]}), "gives"),
    _refused("program of another state", _other_program(lambda x, u, t: x, (9,), (3,), ()), "step.bin", "takes"),
    _refused("program of another result", _other_program(lambda x, u, t: x[1:], (10,), (3,), ()), "step.bin", "gives"),
    _refused("program that calls a kernel", _other_program(_foreign_call, (10,), (3,), ()), "calls code outside XLA"),
    _refused("names are no JSON", _about("{"), "is no JSON"),
    _refused("names are no UTF-8", _with(plant_dot_json=b"\xff\xfe{}"), "is no JSON"),
    _refused("names nested deep", _about(_DEEP), "plant.json"),
    _refused("names a list", _about("[]"), "schema"),
    _refused("schema true", _about(schema=True), "schema True"),
    _refused("schema of before", _about(schema=1), "schema 1", "export it again"),
    *[_refused(f"{key} missing", make, f"{key} is missing") for key, make in _CHANGED.items()],
    _refused("dt negative", _about(dt=-0.2), "dt is no positive number"),
    _refused("dt a text", _about(dt="0.2"), "dt is no positive number"),
    _refused("dt not finite", _about(dt=float("nan")), "dt is no positive number"),
    _refused("dtype float16", _about(dtype="float16"), "dtype is neither"),
    _refused("dtype of other programs", _about(dtype="float32"), "takes other arrays", "float32"),
    _refused("state named twice", _about(states=["u"] * 10), "states is no list of distinct names"),
    _refused("inputs a text", _about(inputs="abc"), "inputs is no list"),
    _refused("an output too many", _about(outputs=[f"y{i}" for i in range(11)]), "output.bin"),
    _refused("start too short", _about(start=[0.0]), "start has not one finite number"),
    _refused("start not finite", _about(start=[float("inf")] * 10), "start has not one finite number"),
    _refused("start beyond float", _about(start=[10**400] * 10), "start has not one finite number"),
    _refused("trim of texts", _about(trim=["0"] * 3), "trim has not one finite number"),
]
