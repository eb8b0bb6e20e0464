"""Vehicle files whose keys contradict each other, mean nothing or strain the reader."""

from pathlib import Path

from corpus import Case
from vehicle_texts import BODY, RIG

from jaxsub.vehicle import read_vehicle

BOUNDS, SIGMA, DOF, TITLE = "bounds =", "sigma = 0.003", '["x", "y"]', 'name = "rig"'
_MANY = str([f"q{i}" for i in range(500)])
# name, what is written instead of what, and words of the refusal
REFUSED = [
    ("schema true", "schema = 1", "schema = true", "schema: is True"),
    ("schema a fraction", "schema = 1", "schema = 1.0", "schema: is 1.0"),
    ("schema a text", "schema = 1", 'schema = "1"', "schema: is '1'"),
    ("name a number", 'name = "body"', "name = 3", "name: 3 is not a word"),
    ("name blank", 'name = "body"', 'name = " "', "name: ' ' is not a word"),
    ("fixed and free", BOUNDS, "fixed = true, free = true, bounds =", "Y_v: has both fixed and free; write one"),
    ("fixed and not free", BOUNDS, "fixed = true, free = false, bounds =", "Y_v: has both fixed and free"),
    ("free a word", BOUNDS, 'free = "no", bounds =', "Y_v.free: is 'no'; write true or false"),
    ("fixed a number", BOUNDS, "fixed = 1, bounds =", "Y_v.fixed: is 1; write true or false"),
    ("value a text", "value = -60.0", 'value = "-60.0"', "Y_v: '-60.0' is not a finite number"),
    ("sigma a text", SIGMA, 'sigma = "0.003"', "outputs.r.sigma: '0.003' is not a finite number"),
    ("bounds of text", "[-100.0, 0.0]", '["-100", "0"]', "Y_v.bounds: is"),
    ("prior a text", BOUNDS, 'prior_std = "3", bounds =', "Y_v.prior_std: is '3'"),
    ("unit nonsense", BOUNDS, 'unit = "nonsense", bounds =', "Y_v.unit: unknown unit 'nonsense'"),
    (
        "unit not SI",
        BOUNDS,
        'unit = "N/(cm/s)", bounds =',
        "numbers of a vehicle file are in SI; give the number in N/",
    ),
    ("unit another", BOUNDS, 'unit = "N", bounds =', "Y_v.unit: is 'N', and the number is in N/(m/s)"),
    ("unit a number", BOUNDS, "unit = 1, bounds =", "Y_v.unit: 1 is not a word"),
    ("unit ambiguous", BOUNDS, 'unit = "M", bounds =', "unit 'M' is ambiguous; write m (metre)"),
    ("mass in grams", "mass = 50.0", 'mass = { value = 50.0, unit = "g" }', "body.mass.unit: is 'g'"),
    ("length in cm", "mass =", 'length = { value = 2, unit = "cm" }\nmass =', "give the number in m"),
    ("length free", "mass =", "length = { value = 2, free = true }\nmass =", "body.length.free: length is not"),
    ("degrees", "N_delta_r = -12.0", 'N_delta_r = { value = -0.2, unit = "N*m/deg" }', "N_delta_r.unit: is 'N*m/deg'"),
    ("standard error", BOUNDS, "standard_error = 1.0, bounds =", "Y_v.standard_error: is what a fit answers"),
    ("mean without spread", BOUNDS, "prior_mean = 1.0, bounds =", "prior_mean: is given without prior_std"),
    ("arm of a rate", SIGMA, "sigma = 0.003\nlever_arm = [1, 0, 0]", "outputs.r.lever_arm: r does not use it"),
    ("another expression", "parameters", 'expression = "Y v"\nparameters', "effects[1].expression: is not"),
    ("column without name", '"delta_r"', '""', "inputs.rudder: '' is not a column name"),
    ("column with unit", '"delta_r"', '"delta_r[deg]"', "has brackets; name the column without its unit"),
    ("NUL in a column", '"delta_r"', '"delta\\u0000r"', "inputs.rudder", "has a character that cannot be printed"),
    ("NUL in a key", "Y_v =", '"Y\\u0000v" =', "has a character that cannot be printed"),
    ("bell in a name", '"body"', '"bo\\u0007dy"', "name: 'bo\\x07dy' has a character"),
    ("long name", '"body"', '"' + "b" * 1001 + '"', "name: has a text of 1001 characters; write 1000 at most"),
    ("long key", "Y_v =", "Y" * 2000 + " =", "has a text of 2000 characters"),
    ("deep lists", "mass = 50.0", "mass = " + "[" * 30 + "]" * 30, "is nested more than 20 deep"),
    ("deep tables", "mass = 50.0", "mass" + ".a" * 3000 + " = 1", "is nested more than 20 deep"),
    ("endless brackets", "mass = 50.0", "mass = " + "[" * 100_000, "is not TOML"),
    ("huge integer", "mass = 50.0", "mass = 1" + "0" * 400, "mass: 1000"),
    ("endless integer", "mass = 50.0", "mass = " + "9" * 5000, "is not TOML"),
    ("beyond float", "mass = 50.0", "mass = 1e999", "mass: inf is not a finite number"),
    ("below float", "mass = 50.0", "mass = 1e-999", "mass: is 0; give a positive number"),
    ("many effects", "[[effects]]", "[[effects]]\n" * 99, "effects: are 101; give 100 at most"),
    ("a date", "mass = 50.0", "mass = 1979-05-27", "is not a finite number"),
]
RIG_REFUSED = [
    ("body of a mechanism", TITLE, 'name = "rig"\nbody = {}', "body: is a part of a submerged body; delete it"),
    ("motion of a mechanism", TITLE, 'name = "rig"\nprescribed.u = "u"', "prescribed: is a part of a submerged body"),
    ("500 coordinates", DOF, _MANY, "dof: names 500 coordinates, whose matrices have 750000 entries; name 30 at most"),
    ("coordinate and rate", DOF, '["x", "x_rate"]', "dof: makes x_rate both the rate of x and x_rate"),
    ("coefficient of two", DOF, '["x", "y", "x_y"]', "makes I_x_y both the inertia between x and y and"),
    ("coordinate no word", DOF, '["x", "y z"]', "dof.y z: is not a word"),
    ("arm of a coordinate", "x_rate.sigma = 0.1", "x_rate.lever_arm = [0, 0, 0]", "x_rate does not use it"),
    ("stiffness not SI", "K_x = 3", 'K_x = { value = 3, unit = "N/cm" }', "K_x.unit: is 'N/cm', and numbers"),
]


def _case(text: str, name: str, old: str, new: str, *words: str) -> Case:
    def make(folder: Path) -> object:
        assert old in text
        (folder / "vehicle.toml").write_text(text.replace(old, new, 1), encoding="utf-8")
        return read_vehicle(folder / "vehicle.toml")

    return Case(f"vehicle: {name}", make, ("vehicle.toml: ", *words))


CASES = [_case(BODY, *row) for row in REFUSED] + [_case(RIG, *row) for row in RIG_REFUSED]
