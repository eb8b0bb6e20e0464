"""Loads a plant that was exported ahead of time; it needs JAX and the file, in which it travels.

sys.path.append("nps.plant")
from plant_loader import load
plant = load("nps.plant")
x = plant.step(plant.start, [0.1, 0.0, 0.0])
"""

import importlib.util
import json
import sys
import zipfile
from types import SimpleNamespace

import jax
from jax import export

# the programs in the file, and what each gives for a state, inputs and a time
PROGRAMS = ("step", "output", "jacobians")


def load(path):
    """The plant in the file `path`.

    `step(x, u, time=0.0)` gives the next state, `output` the measured channels and `jacobians` the matrices A, B, C and
    D; all may be called under jit, and step and output under grad. `states`, `inputs` and `outputs` are names, `dt` the
    s between samples, `start` and `trim` a state and inputs to start from, `about` all that the file says of itself.

    Raises ValueError for a file that is no plant, and where the file's numbers have 64 bits and JAX is set to 32.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            if importlib.util.find_spec("flatbuffers") is None:
                sys.path.append(str(path))  # JAX reads its programs by it, and the file has brought it along
            about = json.loads(archive.read("plant.json"))
            programs = {name: export.deserialize(bytearray(archive.read(f"{name}.bin"))) for name in PROGRAMS}
    except (zipfile.BadZipFile, KeyError) as error:
        raise ValueError(
            f"{path}: is no exported plant ({error}); export one with jaxsub.control.export_plant"
        ) from None
    if about["dtype"] == "float64" and jax.numpy.result_type(float) != "float64":
        raise ValueError(f'{path}: has 64-bit numbers; call jax.config.update("jax_enable_x64", True) first')
    number = lambda values: jax.numpy.asarray(values, about["dtype"])

    def called(program):
        return lambda x, u, time=0.0: program.call(number(x), number(u), number(time))

    functions = {name: jax.jit(called(program)) for name, program in programs.items()}
    names = {key: tuple(about[key]) for key in ("states", "inputs", "outputs")}
    start, trim = number(about["start"]), number(about["trim"])
    return SimpleNamespace(**functions, **names, dt=about["dt"], start=start, trim=trim, about=about)
