"""Numbers of a vehicle file have the units that their symbols say."""

import pint
import pytest
from rigs import oscillator

from jaxsub.vehicle.catalogue import nps_auv_ii, remus_100
from jaxsub.vehicle.coefficient_units import coefficient_unit

UNITS = pint.UnitRegistry()
BY = {"u": "m/s", "v": "m/s", "w": "m/s", "p": "rad/s", "q": "rad/s", "r": "rad/s"}


@pytest.mark.parametrize("vehicle", [nps_auv_ii(), remus_100()], ids=["nps", "remus"])
def test_a_coefficient_times_what_it_multiplies_is_a_force_or_a_moment(vehicle):
    """Claim: by a units library every row of X, Y, Z comes out in N and every row of K, M, N in N m."""
    rows = [row for row in vehicle.layout.parameters if row.name[1] == "_" and row.name[0] in "XYZKMN"]
    assert len(rows) > 15
    for row in rows:
        variable = row.name[2:]
        known = {"0": "", "nn": "rad^2/s^2"} | BY | {f"{name}dot": f"{unit}/s" for name, unit in BY.items()}
        moved = UNITS(known.get(variable, "rad"))
        product = UNITS(row.unit) * (moved if moved else 1.0)
        # an angle has no dimension, so a moment is told from a force by its metre alone
        assert product.check("[force]" if row.name[0] in "XYZ" else "[force] * [length]"), row.name


def test_what_is_no_symbol_has_no_unit():
    """Claim: body entries have theirs, and another name none."""
    assert coefficient_unit("buoyancy") == "N"
    assert coefficient_unit("X_nn") == "N/(rad/s)/(rad/s)"
    assert coefficient_unit("Y_vdotdot") == coefficient_unit("D_q") == ""


def test_a_mechanism_has_no_units_of_a_body():
    """Claim: `q` is a pitch rate of a body, and of a mechanism a coordinate of whatever unit."""
    assert nps_auv_ii().layout.unit("q") == "rad/s"
    assert oscillator().layout.unit("q") == ""
