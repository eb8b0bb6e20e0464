"""`js.sweep` takes a vehicle and recordings, and gives the searches of the plan that the command makes."""

import numpy as np
import pytest
from rigs import driven, oscillator

import jaxsub as js
from jaxsub.sweeps import Plan, open_sweep
from jaxsub.sweeps import sweep as run_plan


@pytest.fixture(scope="module")
def run():
    """A short recording of the oscillator."""
    return js.synthetic(oscillator(), [driven(oscillator(), 0.1 * np.arange(50), 1, amplitude=1.0)], seed=1)[0]


@pytest.fixture(scope="module")
def swept(run, tmp_path_factory):
    """Eight searches, and the folder that keeps them."""
    folder = tmp_path_factory.mktemp("kept") / "sweep"
    return js.sweep(oscillator(), run, starts=8, spread=0.8, folder=folder), folder


def test_searches_are_those_of_the_plan(run, swept, tmp_path):
    """Claim: estimates equal those of a plan run by itself, and the folder holds them."""
    plan = Plan({"oscillator": oscillator()}, {"all": [run]}, 8, spread=0.8)
    by_itself = run_plan(plan, tmp_path / "plan")
    found, folder = swept
    np.testing.assert_array_equal(found.to_xarray().estimate, by_itself.estimate)
    np.testing.assert_array_equal(open_sweep(folder).estimate, by_itself.estimate)
    best = float(by_itself.estimate.sel(coefficient="K_x").values.ravel()[np.argmin(by_itself.cost.values)])
    assert found.to_dataframe().best["oscillator", "all", "K_x"] == best


def test_a_sweep_is_loaded_as_it_was_kept_or_saved(swept, tmp_path):
    """Claim: both folders give the same rates, coefficients and searches; what is no sweep is refused."""
    found, folder = swept
    found.save(tmp_path / "saved")
    for place in (folder, tmp_path / "saved"):
        again = js.Sweep.load(place)
        assert repr(again) == repr(found) and again.summary() == found.summary()
        np.testing.assert_array_equal(again.dataset.estimate, found.dataset.estimate)
    assert found.plot()._repr_png_()[:4] == b"\x89PNG"
    assert "8 of 8 searches reach the least cost" in repr(found) and "Array" not in repr(found)
    with pytest.raises(js.InputError, match="give the folder of a finished sweep"):
        js.Sweep.load(tmp_path)
