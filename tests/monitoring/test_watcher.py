"""A watcher names place and time of a change, counts what is wrong with rows, and goes on after its process ended."""

import dataclasses

import numpy as np
import pytest
from rigs import driven, oscillator

from jaxsub.errors import InputError
from jaxsub.monitoring import Lines, Watcher, rows_of
from jaxsub.simulation import synthetic

RATE = 0.1


@pytest.fixture(scope="module")
def vehicle():
    return oscillator()


@pytest.fixture(scope="module")
def rows(vehicle):
    """800 clean rows, every 0.1 s: time, drive, x and its rate."""
    run = driven(vehicle, 0.1 * np.arange(800), seed=2, amplitude=1.0)
    return rows_of(vehicle, synthetic(vehicle, [run], seed=2))


@pytest.fixture(scope="module")
def flow(vehicle, rows, tmp_path_factory):
    """Events before and after row 403 of rows with faults and, from row 400 on, three sigma of bias on x.

    Those after it also from a watcher that was restored there; and both watchers, with the file between them.
    """
    path = tmp_path_factory.mktemp("watch") / "state"
    watcher = Watcher.of(vehicle, rows[:16], false_alarms_per_hour=RATE, longest=60.0, hours=2.0)
    bad = with_faults(rows)
    early = watched(watcher, bad[:403])
    watcher.save(path, note="kept")
    again, more = Watcher.restored(path, vehicle)
    assert more == {"note": "kept"}
    return early, watched(watcher, bad[403:]), watched(again, bad[403:]), watcher, again, path


def watched(watcher, rows):
    return [event for row in rows for event in watcher.step(row)]


def with_faults(rows):
    """`rows` with NaN, infinite, repeated, backward and untimed ones, a wild measurement, a bias, and then a gap."""
    bad = [row.copy() for row in rows]
    bad[100][2] = np.nan
    bad[120][3] = np.inf
    bad[140][1] = np.nan
    bad[160][0] = bad[159][0]
    bad[184][0] = bad[170][0]
    bad[200][0] = np.nan
    bad[220][2] += 5.0
    for row in bad[400:]:
        row[2] += 0.03
    return bad[:500] + bad[600:]


def test_a_bias_is_an_alarm_at_its_sensor_since_it_set_in(flow):
    """Claim: nothing before 40 s in spite of faulty rows; then within 5 s an alarm at x, since 40 s within a second."""
    alarms = [event for event in flow[0] + flow[1] if event["event"] == "alarm"]
    first = alarms[0]
    assert (first["place"], first["alarm"]) == ("sensor:x", 1)
    assert 40.0 <= first["time"] <= 45.0
    assert first["since"] == pytest.approx(40.0, abs=1.0)
    assert first["false_alarms_per_hour"] <= RATE


def test_what_cannot_be_told_from_the_place_is_listed(flow):
    """Claim: the sensor that errs is the place of every event about it, or among what explains it nearly as well."""
    first, *later = [event for event in flow[0] + flow[1] if "place" in event]
    assert first["or"] == [] and any(event["or"] for event in later)
    for event in (first, *later):
        assert event["place"] not in event["or"]
        assert "sensor:x" in (event["place"], *event["or"])


def test_a_watcher_restored_from_its_file_gives_the_same_events(flow):
    """Claim: written in the midst of a change, read by a new watcher, events and counts go on the same."""
    _, rest, again, watcher, restored, _ = flow
    assert rest
    assert again == rest
    assert restored.status() == watcher.status()


def test_what_is_wrong_with_rows_is_counted(flow):
    """Claim: each kind once, at its channel where it has one."""
    faults = flow[3].status()["faults"]
    assert faults["outputs"] == {"x_rate": 1}
    expected = dict.fromkeys(("inputs", "duplicates", "behind", "untimed", "gaps"), 1)
    assert {name: faults[name] for name in expected} == expected
    # the wild one, and then some of those with the bias
    assert list(faults["rejected"]) == ["x"]


def test_a_state_of_another_vehicle_is_refused(flow):
    """Claim: one line names the file and the vehicle."""
    other = oscillator(coefficients={"D_x": 0.6, "K_x": 5.0, "B_x_drive": 2.0})
    with pytest.raises(InputError, match="is of another vehicle than oscillator"):
        Watcher.restored(flow[-1], other)


def test_lines_are_read_in_their_units_and_malformed_ones_counted(vehicle):
    """Claim: units of the header, order of the vehicle, blank cells missing; half lines and lines of words dropped."""
    lines = Lines("f,x[mm],t[ms],x_rate,other", vehicle.layout, "stream")
    row = lines.row("1.5,20,300,,7")
    assert row is not None
    np.testing.assert_allclose(row, [0.3, 1.5, 0.02, np.nan])
    assert [lines.row(line) for line in ("1.5,20", "a,b,c,d,e", "", "1,2,,3,4")] == [None] * 4
    assert lines.malformed == 4
    assert lines.row(lines.header) is None and lines.malformed == 4
    with pytest.raises(InputError, match="has no column 'x_rate'; did you mean x_rat"):
        Lines("t,f,x,x_rat", vehicle.layout, "stream")


def test_outputs_without_sigma_are_refused(vehicle, rows):
    """Claim: a watcher whose filter cannot know the noise of an output names it."""
    output = dataclasses.replace(vehicle.layout.outputs[0], sigma=None)
    layout = dataclasses.replace(vehicle.layout, outputs=(output, vehicle.layout.outputs[1]))
    with pytest.raises(InputError, match="output x: its sigma is to be estimated"):
        Watcher.of(dataclasses.replace(vehicle, layout=layout), rows[:16])
