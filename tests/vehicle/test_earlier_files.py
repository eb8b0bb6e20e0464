"""Vehicle files of version 1 as earlier releases wrote them read as before, and move as before."""

import json
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest

from jaxsub.vehicle import read_vehicle, vehicle_text

FOLDER = Path(__file__).parent / "earlier"
FILES = sorted(FOLDER.glob("*.toml"))
ACCELERATIONS = json.loads((FOLDER / "accelerations.json").read_text())


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_earlier_file_reads_and_moves_as_before_and_is_written_as_it_was(path):
    """Claim: accelerations at random states are those that the writing release computed, and the text is its text."""
    vehicle = read_vehicle(path)
    assert vehicle_text(vehicle) == path.read_text(encoding="utf-8")
    # a current was felt by linear damping alone when the file was written: it is left out on both sides
    vehicle = vehicle.without_effect("current")
    layout, draws = vehicle.layout, np.random.default_rng(0)
    states = jnp.asarray(draws.normal(size=(3, len(layout.states))) * 0.3)
    signals = jnp.asarray(draws.normal(size=(3, len(layout.held) + len(layout.interpolated))) * 0.3)
    expected = np.array(ACCELERATIONS[path.stem])
    np.testing.assert_allclose(vehicle.acceleration(states, signals), expected, rtol=1e-12, atol=1e-13)
