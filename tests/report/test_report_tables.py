"""Tables say what the numbers say: which columns there are, how far a cell is from the noise, what is suspicious."""

import dataclasses

import tomlkit
from report_examples import VEHICLE, bare, diagnosis

from jaxsub.discrepancy.records.diagnosis import Location
from jaxsub.report import tables


def test_fit_table_has_a_column_for_each_model_there_is():
    both = [("train", "baseline"), ("train", "improved"), ("held_out", "baseline"), ("held_out", "improved")]
    assert tables.fit_columns(diagnosis("named")) == both
    assert tables.fit_columns(diagnosis("unknown")) == both[::2]
    assert tables.fit_columns(diagnosis("unknown", described=True)) == both
    assert tables.fit_columns(bare()) == []
    rows = {row.channel: row.cells for row in tables.fit_rows(diagnosis("named"))}
    assert [(cell.text, cell.tone) for cell in rows["v"]] == [
        ("14.3", "far"), ("1.08", "floor"), ("15.4", "far"), ("1.10", "floor")
    ]  # fmt: skip
    assert [cell.tone for cell in rows["phi"]] == ["off", "floor", "off", "floor"]


def test_a_channel_without_a_stated_noise_is_told_in_its_unit_and_has_no_floor():
    """Claim: w, whose σ is what the baseline left, has rms errors in m/s and no tone; v has both."""
    made = diagnosis("named")
    sigma = {quality.channel: quality.sigma for quality in made.channels}
    rows = {row.channel: row.cells for row in tables.fit_rows(made)}
    assert {cell.tone for cell in rows["w"]} == {""}
    assert rows["v"][0].size == f"{made.fit['train']['baseline']['v'] * sigma['v']:.3g} m/s"
    alone = {"baseline": {"w": 7.0}, "improved": {"w": 0.5}}
    only = dataclasses.replace(made, fit={"train": alone, "held_out": alone})
    found = tables.gain_number(only)
    assert found.value == f"{7.0 * sigma['w']:.2g} → {0.5 * sigma['w']:.2g} m/s"
    assert "σ" not in found.label and "noise" not in found.detail


def test_channel_in_one_column_only_has_a_dash_in_the_others():
    fit = {"train": {"baseline": {"u": 1.0}}, "held_out": {"baseline": {"v": float("nan")}}}
    rows = tables.fit_rows(dataclasses.replace(bare(), fit=fit))
    assert [[cell.text for cell in row.cells] for row in rows] == [["1.00", "–"], ["–", "–"]]


def test_noise_that_is_not_as_stated_is_flagged_both_ways():
    made = diagnosis("named")
    noise = [dataclasses.replace(made.channels[0], sigma=1.0, record_sigma=s) for s in (1.4, 1.6, 0.7, 0.6)]
    noise.append(dataclasses.replace(made.channels[0], sigma=0.0))
    rows = tables.channel_rows(dataclasses.replace(made, channels=noise))
    assert [row.flagged for row in rows] == [False, True, False, True, False]


def test_key_numbers():
    assert tables.gain_number(diagnosis("named")).value == "0.15 → 0.011 m/s"
    assert tables.gain_number(diagnosis("named")).detail == "most improved channel; 15.4 → 1.10 times its noise"
    assert tables.gain_number(diagnosis("unknown")).value == "0.15 m/s"
    assert tables.gain_number(diagnosis("unknown", described=True)).value == "0.15 → 0.011 m/s"
    unquoted = dataclasses.replace(diagnosis("named"), channels=[])
    assert tables.gain_number(unquoted).value == "15.4 → 1.10"
    assert tables.explained_number(diagnosis("named")).value.startswith("97")
    assert tables.explained_number(diagnosis("unknown")) is None
    assert tables.effect_number(diagnosis("unknown")) is None
    assert tables.gain_number(bare()) is None
    assert tables.run_number(diagnosis("none")).detail.startswith("2 for training, 1 for the test")


def test_intervals_are_told_by_run_and_counted_when_many():
    many = [("b", float(start), start + 0.25) for start in range(9)]
    lines = tables.intervals(Location("yaw", 1.0, [("a", 1.0, 1234.56), ("a", 2000.0, 2000.04), *many], []))
    assert lines[0] == "a: 1–1234.6, 2000 s"
    assert lines[1].startswith("b: 0–0.2, 1–1.2,") and lines[1].endswith("5–5.2 s and 3 more")


def test_effects_are_cut_out_of_the_vehicle_file_unchanged():
    cut = tables.effects_text(VEHICLE + "\n[outputs.r]\nsigma = 0.003\n", {"Y_v"})
    assert tomlkit.parse(cut).unwrap() == {"effects": tomlkit.parse(VEHICLE)["effects"].unwrap()}
    assert cut.startswith("[[effects]]")
    assert tables.effects_text("schema = 1\n", ()) == ""


def test_coefficients_that_a_diagnosis_added_are_cut_out_too():
    """Claim: neither what was fitted before nor what is fixed is shown as added."""
    file = '[coefficients]\nY_v = {value = -1.0}\n"K_p|p|" = {value = -0.5}\nY_vdot = {value = 2.0, fixed = true}\n'
    assert tomlkit.parse(tables.effects_text(file, {"Y_v"})).unwrap() == {"coefficients": {"K_p|p|": {"value": -0.5}}}
