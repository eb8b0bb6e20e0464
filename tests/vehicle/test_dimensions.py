"""A column whose unit has another dimension than what a vehicle takes it for is refused by name."""

import numpy as np
import pandas
import pytest
from rigs import oscillator

from jaxsub.effects import CHANNEL_UNITS
from jaxsub.errors import InputError
from jaxsub.estimate import batch
from jaxsub.recording import Recording, from_pandas
from jaxsub.units import si_unit, unit_rate
from jaxsub.vehicle import check_units, vehicle_from
from jaxsub.vehicle.dimensions import _DIMENSIONS


def body():
    """A body that takes a column of every kind; its fin's coefficient needs yaw."""
    data = {
        "schema": 1, "name": "body", "kind": "submerged-body", "dof": ["yaw"], "body": {"mass": 50.0},
        "coefficients": {"N_delta_r": -1.0}, "inputs": {"rudder": "fin", "thrust": "T", "shaft_speed": "n"},
        "prescribed": {"u": "u_log", "theta": "pitch"},
        "environment": {"density": "rho", "ballast": "V", "temperature": "Tw", "altitude": "alt"},
        "outputs": {channel: {"sigma": 0.1} for channel in (*CHANNEL_UNITS, "pressure")},
    }  # fmt: skip
    return vehicle_from(data, "body.toml").layout


DIMENSIONS = {name: si_unit(unit) for name, unit in CHANNEL_UNITS.items()} | {
    "fin": "rad", "T": "N", "n": "rad/s", "u_log": "m/s", "pitch": "rad", "rho": "kg/m³", "V": "m³", "Tw": "K",
    "alt": "m", "pressure": "Pa",
}  # fmt: skip
WRITTEN = {
    "rad": ["rad", "deg", "°", "mrad"], "rad/s": ["rad/s", "deg/s", "rpm", "rev/s", "dps"], "m": ["m", "cm", "ft"],
    "m/s": ["m/s", "knot", "m.s-1"], "m/s²": ["m/s^2", "m s-2", "cm/s2"], "N": ["N", "kgf", "kN"],
    "kg/m³": ["kg/m3", "g/cm^3"], "m³": ["l", "cm^3"], "K": ["degC", "K"], "V": ["V", "mV"], "kg": ["kg", "g"],
    "1": ["1", "pct", "%", "unitless", "1e-3"], "s": ["s", "us", "ms"], "N m": ["Nm", "N.m"], "1/s": ["Hz"],
    "Pa": ["dbar", "kPa", "Pa"],
}  # fmt: skip


def run(**columns):
    """A run of two samples, headed as in a file: `r="deg/s"`."""
    table = {f"{name}[{unit}]" if unit else name: [0.1, 0.2] for name, unit in columns.items()}
    return from_pandas(pandas.DataFrame({"t": [0.0, 1.0]} | table), "run")


def test_files_that_state_no_unit_need_no_table_of_units(monkeypatch):
    def refused(unit):
        raise AssertionError(f"{unit} was looked up")

    monkeypatch.setattr("jaxsub.units._units", refused)
    check_units(body(), [run(**dict.fromkeys(DIMENSIONS, ""))])


@pytest.mark.parametrize("column", DIMENSIONS)
def test_column_is_taken_in_units_of_its_dimension_and_no_other(column):
    for si, units in WRITTEN.items():
        for unit in units:
            if column in ("ax", "ay", "az") and unit == "g":
                continue
            if si == DIMENSIONS[column]:
                check_units(body(), [run(**{column: unit})])
                continue
            with pytest.raises(InputError) as caught:
                check_units(body(), [run(**{column: unit})])
            assert str(caught.value).startswith(f"run, column {column!r}: ")
            assert " is not the unit of a" in str(caught.value)


def test_refusal_names_column_unit_dimension_and_remedy():
    with pytest.raises(InputError) as caught:
        check_units(body(), [run(r="V")])
    assert str(caught.value) == (
        "run, column 'r': volt is not the unit of an angular rate; head it r[…] in rad/s, deg/s or rpm"
    )
    assert set(_DIMENSIONS) == set(DIMENSIONS.values())


def test_acceleration_may_be_in_g():
    check_units(body(), [run(ax="g", ay="mg", az="m/s/s")])


def test_column_without_a_unit_is_si_and_one_that_nobody_takes_is_not_looked_at():
    check_units(body(), [run(r="", fin="", lidar="V", note="kg")])


def test_column_that_cannot_be_used_is_refused_only_where_it_is_taken():
    text = pandas.DataFrame({"t": [0.0, 1.0], "r": ["a", "b"], "note": ["a", "b"]})
    with pytest.raises(InputError, match="row 2, column 'r': 'a' is not a number"):
        check_units(body(), [from_pandas(text)])
    check_units(body(), [from_pandas(text.drop(columns="r"))])


def test_coordinate_may_have_any_unit_if_its_rate_and_other_runs_have_the_same():
    layout = oscillator().layout
    check_units(layout, [run(x="V", x_rate="V/s", f="A"), run(x="mV", f="mA"), run(x="", x_rate="")])
    check_units(layout, [run(x="deg", x_rate="rpm")])
    with pytest.raises(InputError, match=r"column 'x_rate': is in V, and 'x' in V; give it in .*V/s|kg"):
        check_units(layout, [run(x="V", x_rate="V")])
    with pytest.raises(InputError, match="column 'x': is in m, in run in rad; give all runs one unit"):
        check_units(layout, [run(x="deg"), run(x="cm")])


@pytest.mark.parametrize(("unit", "rate"), [("rad", "rad/s"), ("m", "m/s"), ("1", "1/s"), ("m/s", "m/s²")])
def test_rate_of_a_unit(unit, rate):
    assert unit_rate(unit) == rate


def test_a_fit_refuses_them_too():
    times = np.arange(3.0)
    columns = {name: np.zeros(3) for name in ("f", "x", "x_rate")}
    wrong = Recording("run", times, columns, "run", units={"x": "m", "x_rate": "m"})
    with pytest.raises(InputError, match="x_rate"):
        batch(oscillator(), [wrong])
