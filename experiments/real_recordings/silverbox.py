"""Silverbox, an electronic Duffing oscillator (public origin: Wigren and Schoukens 2013, nonlinear benchmark).

One coordinate, a linear oscillator as baseline; trained on the multisine, tested on the multisine's last quarter and on
the arrow, whose end leaves the range that was trained on. Inertia is scaled to 1 V s²/V.
"""

from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pandas as pd

from jaxsub.estimate import batch, search
from jaxsub.recording import Recording
from jaxsub.simulation import simulate
from jaxsub.vehicle import AbstractVehicle, read_vehicle

from ..data import data_folder
from .case import Case
from .preparation import mid_interval
from .run import diagnose_case

_STRETCH, _TRAINED, _JUDGED = 2048, 8, 4  # samples of a stretch; stretches to fit, and to judge by of each test
_SKIPPED, _WITHIN = 50, 32_000  # the benchmark's own: samples not counted, and those of the arrow within range
VEHICLE = """
schema = 1
name = "Silverbox"
kind = "mechanism"
dof = ["y"]
[coefficients]
I_y = { value = 1.0, fixed = true }
D_y = { value = 20.0, bounds = [0.0, 1000.0] }
K_y = { value = 1.8e5, bounds = [1e4, 1e6] }
B_y_drive = { value = 1.5e5 }
F_y = { value = 0.0 }
[inputs]
drive = "u"
[outputs.y]
sigma = "estimate"
"""
PICKED = """
[[effects]]
effect = "cubic-stiffness"
equation = "y"
"""


def segment(rows: pd.DataFrame, name: str) -> Recording:
    """One of the benchmark's parts, whole."""
    part = rows.loc[rows["segment"] == name]
    columns = {"u": part["held"].to_numpy(), "y": part["y_V"].to_numpy()}
    return Recording(name, part["t_s"].to_numpy(), columns, "silverbox_snls80mv.parquet")


def stretches(whole: Recording, count: int) -> list[Recording]:
    """`count` stretches spread over a part."""
    firsts = np.linspace(0, len(whole.times) - _STRETCH, count).astype(int)
    index = np.arange(len(whole.times))
    cut = [whole.select((index >= first) & (index < first + _STRETCH)) for first in firsts]
    names = [f"{whole.name}, from {r.times[0]:.1f} s" for r in cut]
    return [Recording(n, r.times - r.times[0], r.columns, f"{r.source}, {n}") for n, r in zip(names, cut, strict=True)]


def parts() -> dict[str, Recording]:
    """The benchmark's split."""
    rows = pd.read_parquet(data_folder("silverbox") / "silverbox_snls80mv.parquet")
    rows["held"] = mid_interval(rows["u_V"].to_numpy())
    return {name: segment(rows, name) for name in ("train_multisine", "test_multisine", "test_arrow")}


def case(split: dict[str, Recording]) -> Case:
    """Stretches of the benchmark's parts, for the diagnosis; the figures beside the published ones are of the whole."""
    return Case(
        vehicle=VEHICLE,
        train=stretches(split["train_multisine"], _TRAINED),
        held=[*stretches(split["test_multisine"], _JUDGED), *stretches(split["test_arrow"], _JUDGED)],
        prepared=(
            f"{_TRAINED} stretches of {_STRETCH} samples of the training multisine, {_JUDGED} of each test; the input, "
            "which is band-limited and not held, as the held values of equal effect"
        ),
        picked=PICKED,
        channels={"y": (1e3, "mV")},
        parameters={
            "D_y": (1.0, "1/s"),
            "K_y": (1.0, "1/s^2"),
            "B_y_drive": (1.0, "1/s^2"),
            "F_y": (1.0, "V/s^2"),
            "k_3": (1.0, "1/(V^2 s^2)"),
        },
        published={
            "linear: multisine / arrow / arrow within range, mV": "6.96 / 14.4 / 6.58",
            "pNARX": "0.64 / 2.25 / 0.57",
            "GP NARX": "0.30 / 0.60 / 0.26",
            "PNLSS, arrow": 0.26,
        },
    )


def report(out: Path) -> dict:
    """Diagnose, then run the models free through the whole tests."""
    split = parts()
    diagnosis, results = diagnose_case(case(split), out)
    fitted = {c.name: jnp.asarray(c.baseline.value) for c in diagnosis.coefficients if c.baseline}
    models = {
        "baseline": read_vehicle(out / "vehicle.toml").with_values(fitted),
        "improved": read_vehicle(out / "improved.toml"),
        "by hand": read_vehicle(out / "by_hand.toml"),
    }
    results["whole_test_rmse_mV"] = {name: whole_tests(model, split) for name, model in models.items()}
    return results


def whole_tests(vehicle: AbstractVehicle, split: dict[str, Recording]) -> dict[str, float]:
    """Open-loop simulation error by the benchmark's three metrics."""
    multisine, arrow = (free_run_error(vehicle, split[part]) for part in ("test_multisine", "test_arrow"))
    rms = lambda error: 1e3 * float(np.sqrt(np.mean(error[_SKIPPED:] ** 2)))
    return {"multisine": rms(multisine), "arrow": rms(arrow), "arrow within range": rms(arrow[:_WITHIN])}


def free_run_error(vehicle: AbstractVehicle, whole: Recording) -> np.ndarray:
    """Measured less simulated (V), the initial state found from the first stretch alone."""
    first = whole.select(np.arange(len(whole.times)) < _SKIPPED)
    start = search(vehicle, batch(vehicle, [first]), sigma=jnp.array([1e-3]), moving=False).start
    return whole.column("y") - np.asarray(simulate(vehicle, batch(vehicle, [whole]), start))[0, :, 0]
