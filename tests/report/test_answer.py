"""The answer of a diagnosis on the terminal and in its folder: one content, valid JSON, whole names and numbers."""

import dataclasses
import html
import json
import math
import re
import tomllib
from pathlib import Path

import click
import jax.numpy as jnp
import pytest
from report_examples import bare, diagnosis
from rigs import write_rig

import jaxsub as js
from jaxsub.api.diagnoses import Diagnosis
from jaxsub.cli import main
from jaxsub.cli.diagnose import added, emit
from jaxsub.cli.options import Options
from jaxsub.discrepancy.records.diagnosis import Explained
from jaxsub.effects import QuadraticDamping, numbers, vocabulary
from jaxsub.report.text import file_stem
from jaxsub.vehicle.catalogue import dsrv


def shown(capsys, made, **options):
    with click.Context(click.Command("diagnose"), obj=Options(**options)):
        emit(Diagnosis(made, dsrv()))
    return capsys.readouterr().out


@pytest.mark.parametrize("verdict", ["none", "named", "ambiguous", "unknown"])
def test_the_sentence_is_whole_at_any_width(verdict, capsys):
    """Claim: in a pipe, which is taken to be 80 columns wide, no word of the sentence in its frame is cut off."""
    made = diagnosis(verdict, samples=40)
    lines = re.findall(r"^│ (.*) │$", shown(capsys, made).partition("╰")[0], re.MULTILINE)
    assert " ".join(" ".join(lines).split()) == Diagnosis(made, dsrv()).sentence
    assert len(lines) > 1 and max(map(len, lines)) <= 76


@pytest.mark.parametrize("verdict", ["none", "named", "ambiguous", "unknown"])
def test_json_is_the_file_and_nothing_else(verdict, capsys, tmp_path):
    """Claim: with numbers that are not finite too, standard output is one valid JSON text, that of the file."""
    made = diagnosis(verdict, samples=40)
    lost = {
        part: {m: rms | {"v": math.inf, "z": math.nan} for m, rms in both.items()} for part, both in made.fit.items()
    }
    made = dataclasses.replace(made, p_value=math.nan, fit=lost, explained=Explained(None, {}, False, False))
    content = json.loads(shown(capsys, made, json=True), parse_constant=pytest.fail)
    assert content["verdict"] == verdict and content["mismatch"]["p_value"] is None
    assert content["fit"]["held_out"]["baseline"]["v"] is None and content["explained"] is None
    assert [one["check"] for one in content["warnings"]] == ["sentinel", "header-row"]
    if verdict == "none":
        Diagnosis(made, dsrv()).write(tmp_path)
        assert json.loads((tmp_path / "diagnosis.json").read_text(encoding="utf-8")) == content
        assert {path.name for path in tmp_path.iterdir()} == {
            "diagnosis.json",
            "diagnosis.npz",
            "improved.toml",
            "report.html",
            "figures",
        }


def test_accepted_effect_of_one_derivative_is_a_coefficient_in_file_and_page_and_is_gone_on_from(tmp_path):
    """Claim: `improved.toml` and the report have `M_q|q|`, diagnosis.json the effect, and --begin begins with it."""
    improved = dsrv().with_effect(QuadraticDamping("pitch", jnp.asarray(-2e4)))
    made = diagnosis("named", samples=40)
    known = [dataclasses.replace(made.coefficients[0], name=name) for name in dsrv().values()]
    Diagnosis(dataclasses.replace(made, coefficients=known), improved).write(tmp_path)
    file = tomllib.loads((tmp_path / "improved.toml").read_text(encoding="utf-8"))
    assert file["coefficients"]["M_q|q|"] == {"value": -2e4}
    assert "effects" not in file
    page = html.unescape((tmp_path / "report.html").read_text(encoding="utf-8"))
    assert '"M_q|q|" = {value = -20000.0}' in page
    (begun,) = added(dsrv(), tmp_path / "improved.toml", vocabulary())
    assert begun.label == "quadratic-damping[pitch]"
    assert numbers(begun) == {"coefficient": -2e4}


def test_the_terminal_has_the_verdict_the_effect_and_the_errors_whole(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "40")
    made = diagnosis("named", samples=40)
    long = {"a_channel_with_a_name_that_no_terminal_of_40_columns_holds": 1234.5}
    fit = {"held_out": {"baseline": long, "improved": dict.fromkeys(long, 1.02)}}
    said = shown(capsys, dataclasses.replace(made, fit=fit))
    assert "named" in said and "crossflow-drag[horizontal]" in said and "0.614 ± 0.021" in said
    assert next(iter(long)) in said and "1230" in said and "1.02" in said


def test_the_least_diagnosis_is_shown(capsys):
    assert "none" in shown(capsys, bare())


def test_a_figures_file_has_a_plain_short_name_of_its_own():
    assert file_stem("sweep-NPS_II-run.1") == "sweep-NPS_II-run.1"
    names = ["../../etc/passwd", "..\\..\\etc\\passwd", "a" * 400, "a" * 401, "深さ", "深い", "nul\0", "a b", "a_b"]
    stems = [file_stem(name) for name in names]
    assert len(set(stems)) == len(names) and max(map(len, stems)) < 128
    assert all("/" not in stem and "\\" not in stem and stem.isascii() and stem.isprintable() for stem in stems)


def test_the_front_door_hands_over_what_the_command_does(tmp_path, monkeypatch, capsys):
    """Claim: checked runs, test run and effects are those of `jaxsub diagnose`; it saves and shows the same answer."""
    write_rig(tmp_path)
    write = lambda name, run: js.save(run, tmp_path / f"{name}.csv")
    run = js.load(tmp_path / "run.csv")
    write("other", run.between(1.0, 12.0))
    handed = []
    made = diagnosis("named", samples=40)

    def conclude(vehicle, train, test, **options):
        handed.append([[r.columns["x"].tolist() for r in runs] for runs in (train, test)])
        handed[-1].append(options["vocabulary"])
        return made, vehicle

    monkeypatch.setattr("jaxsub.api.diagnoses.conclude", conclude)
    # the page and its figures have tests of their own
    monkeypatch.setattr("jaxsub.report.write_report", lambda *_: None)
    monkeypatch.setattr("jaxsub.report.draw", lambda _: {"scan": "the scan"})
    paths = [tmp_path / "vehicle.toml", tmp_path / "run.csv", tmp_path / "other.csv"]
    monkeypatch.setattr("sys.argv", ["jaxsub", "diagnose", *map(str, paths), "--out", str(tmp_path / "out")])
    main()
    runs = [js.load(path) for path in paths[1:]]
    found = js.diagnose(js.read_vehicle(paths[0]), runs, effects=js.vocabulary())
    js.diagnose(js.read_vehicle(paths[0]), runs[0], runs[1], effects=js.vocabulary())
    assert handed[0] == handed[1] == handed[2] and len(handed[0][0]) == len(handed[0][1]) == 1
    found.save(tmp_path / "saved")
    for name in ("diagnosis.json", "improved.toml"):
        assert (tmp_path / "saved" / name).read_bytes() == (tmp_path / "out" / name).read_bytes()
    assert made.summary in repr(found) and "0.614 ± 0.021" in found.summary() and "0.614" in found._repr_html_()
    assert set(found.to_dataframe().effect) == {one.label for one in made.physics}
    assert found.plot() == found.plot("scan") == "the scan"
    with pytest.raises(js.InputError, match="there is no figure 'none'"):
        found.plot("none")


def test_python_of_the_readme_runs(tmp_path, monkeypatch, capsys):
    """Claim: on a vehicle file and three runs the block prints a fit and the diagnosis, and saves the latter."""
    write_rig(tmp_path)
    for index, end in enumerate((12.0, 11.0, 10.0), start=1):
        js.save(js.load(tmp_path / "run.csv").between(0.0, end), tmp_path / f"run{index}.csv")
    readme = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"^```python\n(.*?)^```", readme, re.MULTILINE | re.DOTALL)
    made = diagnosis("named", samples=40)
    monkeypatch.setattr("jaxsub.api.diagnoses.conclude", lambda vehicle, *_, **options: (made, vehicle))
    monkeypatch.setattr("jaxsub.report.write_report", lambda *_: None)
    monkeypatch.chdir(tmp_path)
    exec(block, {})
    said = capsys.readouterr().out
    assert "The fit " in said and "B_x_drive" in said and made.summary in said
    assert (tmp_path / "result" / "improved.toml").exists()
    assert len(block.splitlines()) <= 15
