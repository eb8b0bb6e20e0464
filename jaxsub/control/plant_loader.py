"""Loads a plant that was exported ahead of time; this file needs JAX and flatbuffers, and travels beside the plant.

from plant_loader import load
plant = load("nps.plant")
x = plant.step(plant.start, [0.1, 0.0, 0.0])

A plant file is data: nothing of it is imported or run before it is checked, and its programs may call no code outside
XLA but the linear algebra that JAX brings.
"""

import importlib.util
import json
import os
import re
import sys
import zipfile
import zlib
from types import SimpleNamespace

import jax
from jax import export

SCHEMA = 2
# the programs in the file, and what each gives for a state, inputs and a time
PROGRAMS = ("step", "output", "jacobians")
MEMBERS = ("plant.json", *(f"{name}.bin" for name in PROGRAMS))

# Unpacked bytes for each byte of the file. Programs and names shrink to a half or a fifth; zeros to a thousandth.
_MOST_RATIO, _ALLOWANCE = 50, 2**20
# what JAX's linear algebra compiles to; callbacks into Python and kernels that a file brings are not among these
_CALLS = re.compile(r'custom_call @"?((lapack|cusolver|cublas|cusparse|cu|hipsolver|hip)_\w+|stablehlo\.\w+)"?\(')
_EXPORT = "export it again with jaxsub.control.export_plant"


class PlantError(ValueError):
    """A file is no plant. `parts` are where, what is wrong and what to do about it."""

    def __init__(self, where, what, remedy=_EXPORT):
        super().__init__(" ".join(f"{where}: {what}; {remedy}".split()))
        self.parts = (str(where), what, remedy)


def load(path):
    """The plant in the file `path`.

    `step(x, u, time=0.0)` gives the next state, `output` the measured channels and `jacobians` the matrices A, B, C and
    D; all may be called under jit, and step and output under grad. `states`, `inputs` and `outputs` are names, `dt` the
    s between samples, `start` and `trim` a state and inputs to start from, `about` all that the file says of itself.

    Raises PlantError, a ValueError, for a file that is no plant, that was damaged or that brings code, and where the
    file's numbers have 64 bits and JAX is set to 32; ModuleNotFoundError where flatbuffers is not installed.
    """
    if importlib.util.find_spec("flatbuffers") is None:
        what = "JAX reads its programs by the package flatbuffers, which is not installed; pip install flatbuffers"
        raise ModuleNotFoundError(f"{path}: {what}", name="flatbuffers")
    members = _members(path)
    about = _about(path, members.pop("plant.json"))
    if about["dtype"] == "float64" and jax.numpy.result_type(float) != "float64":
        remedy = 'call jax.config.update("jax_enable_x64", True) first'
        raise PlantError(path, "has 64-bit numbers and JAX is set to 32", remedy)
    programs = {name: _program(path, name, members[f"{name}.bin"], about) for name in PROGRAMS}
    number = lambda values: jax.numpy.asarray(values, about["dtype"])

    def called(program):
        return lambda x, u, time=0.0: program.call(number(x), number(u), number(time))

    functions = {name: jax.jit(called(program)) for name, program in programs.items()}
    names = {key: tuple(about[key]) for key in ("states", "inputs", "outputs")}
    start, trim = number(about["start"]), number(about["trim"])
    return SimpleNamespace(**functions, **names, dt=about["dt"], start=start, trim=trim, about=about)


def _members(path):
    """The unpacked members of the file by name, when they are those of a plant and not large beside the file."""
    if not os.path.isfile(path):
        raise PlantError(path, "is no file", "give the path of an exported plant")
    try:
        with zipfile.ZipFile(path) as archive:
            listed = archive.infolist()
            for name in (entry.filename for entry in listed):
                if name not in MEMBERS:
                    raise PlantError(path, f"holds {name[:80]!r}, and a plant file holds {', '.join(MEMBERS)}")
            if sorted(entry.filename for entry in listed) != sorted(MEMBERS):
                raise PlantError(path, f"does not hold each of {', '.join(MEMBERS)} once")
            size, most = sum(entry.file_size for entry in listed), _MOST_RATIO * os.path.getsize(path) + _ALLOWANCE
            if size > most:
                raise PlantError(path, f"claims {size} bytes unpacked, of which {most} fit a file of its size")
            if any(entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED) for entry in listed):
                raise PlantError(path, "is packed by another method than deflate")
            # of each no more than the bytes it claims are unpacked
            return {entry.filename: archive.read(entry) for entry in listed}
    except (zipfile.BadZipFile, zlib.error, EOFError, OSError, RuntimeError, NotImplementedError) as error:
        raise PlantError(path, f"is no exported plant or is damaged ({error})") from None


def _about(path, text):
    """What `plant.json` says, when each part of it has its type, and vectors the length of their names."""
    try:
        about = json.loads(text.decode())
    except (ValueError, RecursionError) as error:
        raise PlantError(path, f"plant.json is no JSON ({str(error)[:120]})") from None
    if not isinstance(about, dict) or about.get("schema") is True or about.get("schema") != SCHEMA:
        found = about.get("schema") if isinstance(about, dict) else None
        raise PlantError(path, f"plant.json has schema {str(found)[:20]}, and this loader reads {SCHEMA}")
    checks = {
        "name": (_is_text, "is no text"),
        "dt": (lambda dt: _is_number(dt) and dt > 0, "is no positive number"),
        "dtype": (lambda kind: kind in ("float32", "float64"), "is neither float32 nor float64"),
        **dict.fromkeys(("states", "inputs", "outputs"), (_are_names, "is no list of distinct names")),
        "start": (lambda x: _are_numbers(x, about["states"]), "has not one finite number for each state"),
        "trim": (lambda u: _are_numbers(u, about["inputs"]), "has not one finite number for each input"),
        "effects": (lambda effects: isinstance(effects, list) and all(map(_is_text, effects)), "is no list of texts"),
        "values": (lambda values: isinstance(values, dict), "is no table"),
    }
    for key, (holds, what) in checks.items():
        if key not in about:
            raise PlantError(path, f"plant.json: {key} is missing")
        if not holds(about[key]):
            raise PlantError(path, f"plant.json: {key} {what}")
    return about


def _program(path, name, serialized, about):
    """The program `name`, when its arrays are of the shapes that the names tell and it calls nothing but XLA."""
    where, size = f"{path}: {name}.bin", {key: len(about[key]) for key in ("states", "inputs", "outputs")}
    s, m, c = size["states"], size["inputs"], size["outputs"]
    shapes = {"step": [(s,)], "output": [(c,)], "jacobians": [(s, s), (s, m), (c, s), (c, m)]}[name]
    try:
        program = export.deserialize(bytearray(serialized))
        given, found = ([(a.shape, str(a.dtype)) for a in avals] for avals in (program.in_avals, program.out_avals))
        with_slopes = [program, program.vjp()] if program.has_vjp() else [program]
        texts = [part.mlir_module() for part in with_slopes]
    except Exception as error:  # whatever the parsers of JAX raise for bytes that are no program
        said = f"{type(error).__name__}: {error}"[:120]
        raise PlantError(where, f"is no program that JAX {jax.__version__} reads ({said})") from None
    for arrays, expected, what in ((given, [(s,), (m,), ()], "takes"), (found, shapes, "gives")):
        if arrays != [(shape, about["dtype"]) for shape in expected]:
            listed = ", ".join(map(str, expected))
            raise PlantError(where, f"{what} other arrays than plant.json tells, which are {about['dtype']} {listed}")
    for text in texts:
        if text.count("custom_call") != len(_CALLS.findall(text)):
            raise PlantError(where, "calls code outside XLA", "load only plants that jaxsub.control.export_plant wrote")
    return program


def _is_number(value):
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= sys.float_info.max


def _are_numbers(values, names):
    return isinstance(values, list) and len(values) == len(names) and all(map(_is_number, values))


def _is_text(value):
    return isinstance(value, str)


def _are_names(values):
    texts = isinstance(values, list) and all(isinstance(value, str) and value for value in values)
    return texts and len(set(values)) == len(values)
