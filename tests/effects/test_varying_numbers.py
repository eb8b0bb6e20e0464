"""A number that differs by run is an effect of the vocabulary that a vehicle has as `varies = "run"`."""

import jax.numpy as jnp
import pytest
from rigs import oscillator

from jaxsub.effects import VOCABULARY, Facts, QuadraticDamping, RunVariation, candidates, vocabulary
from jaxsub.errors import InputError
from jaxsub.vehicle import added_effects, numbers_that_may_vary, read_vehicle, vehicle_text

EFFECT = RunVariation("B_x_drive", "N", ("x",), jnp.asarray(0.3))


def test_a_vehicle_with_it_has_a_deviation_more_and_is_written_as_such(tmp_path):
    """Claim: it adds one state, and one number `varies`; the written file reads back the same, and names the effect."""
    vehicle = oscillator().with_effect(EFFECT)
    assert vehicle.layout.states == ("x_rate", "x", "B_x_drive.deviation") and vehicle.effects == ()
    assert [row.name for row in vehicle.layout.parameters if row.varies] == ["B_x_drive"]
    (tmp_path / "vehicle.toml").write_text(vehicle_text(vehicle), encoding="utf-8")
    again = read_vehicle(tmp_path / "vehicle.toml")
    assert again.layout == vehicle.layout
    assert float(again.spreads["B_x_drive"]) == 0.3
    (found,) = added_effects(again, oscillator(), vocabulary())
    assert (found.label, float(found.spread)) == ("run-variation[B_x_drive]", 0.3)
    assert added_effects(again, again, vocabulary()) == []


def test_it_is_taken_away_alone():
    """Claim: beside another number that differs, and an effect, taking it away leaves these; and both leave nothing."""
    drag = QuadraticDamping("x", jnp.asarray(-0.1))
    both = oscillator().with_effect(drag).with_effect(RunVariation("D_x", spread=jnp.asarray(0.1))).with_effect(EFFECT)
    fewer = both.without_effect(EFFECT.label)
    assert fewer.layout == oscillator().with_effect(drag).with_effect(RunVariation("D_x")).layout
    assert [effect.label for effect in fewer.all_effects] == [drag.label, "run-variation[D_x]"]
    bare = fewer.without_effect(drag.label).without_effect("run-variation[D_x]")
    assert bare.layout == oscillator().layout and bare.spreads == {}


def test_it_is_a_candidate_of_what_the_facts_list_and_no_entry_of_a_file(tmp_path):
    """Claim: each number that may vary is one candidate; `[[effects]]` refuses the name; commands never vary."""
    known = Facts("mechanism", ("x",), ("drive",), ("x",), (), 0.0, 0.0, {}, 0.1, varying=(("D_x", "", ("x",)),))
    (found,) = candidates(known, (RunVariation,))
    assert (found.label, found.where, found.name) == ("run-variation[D_x]", ("x",), "run-variation")
    assert RunVariation in vocabulary() and RunVariation not in VOCABULARY
    text = vehicle_text(oscillator()) + '[[effects]]\neffect = "run-variation"\nnumber = "D_x"\n'
    (tmp_path / "vehicle.toml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match="effect"):
        read_vehicle(tmp_path / "vehicle.toml")
    assert {"D_x", "K_x", "B_x_drive"} <= numbers_that_may_vary(oscillator())
