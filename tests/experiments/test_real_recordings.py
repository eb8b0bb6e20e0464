"""Every set of the real recordings is a vehicle file and runs that fit each other, with errors in the units it says."""

import jax.numpy as jnp
import numpy as np
import pytest

from experiments.data import data_folder
from experiments.real_recordings import emps, rolldecay, seaglider, silverbox, slocum, zigzag
from experiments.real_recordings.by_hand import free_run_errors
from experiments.real_recordings.preparation import held_means, mid_interval
from experiments.real_recordings.run import in_field_units
from jaxsub.discrepancy.records.diagnosis import ParameterEstimate
from jaxsub.recording import Recording
from jaxsub.vehicle import read_vehicle

CASES = {
    "seaglider_sg542": lambda: seaglider.case(True),
    "slocum_comet2016": lambda: slocum.case(False),
    "kvlcc2_freerunning": zigzag.case,
    "kvlcc2_rolldecay": lambda: rolldecay.case("0 kn"),
    "emps": emps.case,
    "silverbox": lambda: silverbox.case(silverbox.parts()),
}


@pytest.mark.parametrize("name", sorted(CASES))
def test_vehicle_file_reads_and_its_columns_are_in_every_run(name, tmp_path):
    try:
        data_folder(name)
    except SystemExit:
        pytest.skip("these recordings are not here")
    case = CASES[name]()
    texts = {"vehicle": case.vehicle, "picked": case.vehicle + case.picked}
    for label, text in texts.items():
        (tmp_path / f"{label}.toml").write_text(text, encoding="utf-8")
    vehicle, picked = (read_vehicle(tmp_path / f"{label}.toml") for label in texts)
    assert len(picked.effects) > len(vehicle.effects) == 0
    layout = vehicle.layout
    assert set(case.channels) == set(layout.channels)
    for run in [*case.train, *case.held]:
        run.inputs([*layout.held, *layout.interpolated])
        assert all(np.isfinite(run.column(channel)).all() for channel in layout.channels)
    fitted = {(run.source, run.first_row) for run in case.train}
    assert fitted.isdisjoint((run.source, run.first_row) for run in case.held)


def test_held_means_keep_the_impulse():
    values = np.random.default_rng(0).normal(size=23)
    means = held_means(values, 5)
    assert means.shape == (5,)
    assert np.dot(means, [5, 5, 5, 5, 3]) == pytest.approx(values.sum())


def test_held_values_of_a_sine_have_its_own_response():
    # a first-order lag a·ẏ = u - y, exact under a hold, against its closed answer to the sine between samples too
    samples, cycles, lag = 4096, 640, 8.0
    k = np.arange(samples)
    omega = 2.0 * np.pi * cycles / samples
    held = mid_interval(np.sin(omega * k))
    decay, y = np.exp(-1.0 / lag), np.zeros(samples)
    for i in range(samples - 1):
        y[i + 1] = decay * y[i] + (1.0 - decay) * held[i]
    exact = (np.sin(omega * k) - omega * lag * np.cos(omega * k)) / (1.0 + (omega * lag) ** 2)
    late = slice(512, None)
    naive = np.zeros(samples)
    for i in range(samples - 1):
        naive[i + 1] = decay * naive[i] + (1.0 - decay) * np.sin(omega * i)
    miss = lambda x: np.sqrt(np.mean((x - exact)[late] ** 2) / np.mean(exact[late] ** 2))
    # the hold's images at k/Δ ± f are left, Σ (f/(k/Δ ± f))² of a lag's answer far above its corner; a rig's lie lower
    assert miss(y) == pytest.approx(np.sinc(cycles / samples) ** -2 - 1.0, rel=0.05)
    assert miss(naive) > 4.0 * miss(y)


def test_free_run_errors_find_the_start_and_nothing_else(tmp_path):
    text = (
        'schema = 1\nname = "rig"\nkind = "mechanism"\ndof = ["x"]\n'
        "[coefficients]\nD_x = 0.3\nK_x = 4.0\n[outputs.x]\nsigma = 0.01\n"
    )
    (tmp_path / "rig.toml").write_text(text, encoding="utf-8")
    t = np.arange(0.0, 12.0, 0.1)
    natural = np.sqrt(4.0 - 0.15**2)
    stiffer = np.sqrt(4.4 - 0.15**2)
    wave = lambda w: 0.5 * np.exp(-0.15 * t) * np.cos(w * t + 0.4)
    runs = [Recording(n, t, {"x": wave(w)}, n) for n, w in (("same", natural), ("stiffer", stiffer))]
    same, other = free_run_errors(read_vehicle(tmp_path / "rig.toml"), runs, jnp.array([0.01]))
    assert np.abs(same).max() < 1e-4
    assert np.sqrt(np.mean(other**2)) > 0.02


def test_estimates_are_written_as_their_field_does():
    found = in_field_units("kappa", ParameterEstimate(4e-10, 1e-11, "1/Pa"), {"kappa": (1e4, "1/dbar")})
    assert found == {"value": pytest.approx(4e-6), "standard_error": pytest.approx(1e-7), "unit": "1/dbar"}
    assert in_field_units("x", ParameterEstimate(2.0, 1.0, "m"), {})["unit"] == "m"
