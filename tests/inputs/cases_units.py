"""Columns in units as people spell them, of another dimension, or of no meaning."""

import math
from pathlib import Path

from corpus import Case

from jaxsub.recording import Recording, load
from jaxsub.vehicle import check_units, vehicle_from

VEHICLE = vehicle_from(
    {
        "schema": 1, "name": "body", "kind": "submerged-body", "dof": ["surge", "yaw"], "body": {"mass": 50.0},
        "coefficients": {"N_delta_r": -1.0, "X_nn": 1e-3},
        "inputs": {"rudder": "delta_r", "thrust": "tau", "shaft_speed": "n"}, "environment": {"density": "rho"},
        "outputs": {"r": {"sigma": 0.1}, "psi": {"sigma": 0.1}, "ax": {"sigma": 0.1}},
    },
    "body.toml",
)  # fmt: skip
_DEG, _TURN = math.pi / 180.0, 2.0 * math.pi
# header of a column that holds 3, and what it is in SI
READ = [
    ("delta_r[rads]", 3.0), ("delta_r[deg]", 3 * _DEG), ("delta_r[Degrees]", 3 * _DEG), ("delta_r[°]", 3 * _DEG),
    ("r[dps]", 3 * _DEG), ("r[deg/s]", 3 * _DEG), ("r[deg s-1]", 3 * _DEG), ("r[rad.s-1]", 3.0),
    ("n[rpm]", 3 * _TURN / 60), ("n[RPM]", 3 * _TURN / 60), ("n[rev/s]", 3 * _TURN), ("n[r/min]", 3 * _TURN / 60),
    ("ax[g]", 3 * 9.80665), ("ax[mg]", 3e-3 * 9.80665), ("ax[m/s2]", 3.0), ("tau[kgf]", 3 * 9.80665),
    ("psi[degrees_north]", 3 * _DEG), ("psi[degT]", 3 * _DEG), ("rho[g/cm3]", 3000.0), ("tau[kN]", 3000.0),
]  # fmt: skip
# columns that no vehicle takes are read as they are, or left alone
BESIDE = ["lead[Nm]", "gyro[V]", "S[PSU]", "c[unitless]", "Mag[µT]", "note[what]", "mode[]", "x[M]", "k[1e-3]"]
REFUSED = [
    ("delta_r[pct]", "a plain number is not the unit of an angle"),
    ("delta_r[%]", "a plain number is not the unit of an angle; head it delta_r[…] in rad or deg"),
    ("delta_r[s]", "second is not the unit of an angle"),
    ("delta_r[us]", "second is not the unit of an angle"),
    ("delta_r[1]", "a plain number is not the unit of an angle"),
    ("delta_r[M]", "unit 'M' is ambiguous; write m (metre)"),
    ("delta_r[C]", "unit 'C' is ambiguous; write degC"),
    ("r[V]", "column 'r': volt is not the unit of an angular rate; head it r[…] in rad/s, deg/s or rpm"),
    ("r[m]", "metre is not the unit of an angular rate"),
    ("r[deg]", "radian is not the unit of an angular rate"),
    ("r[Hz]", "hertz is not the unit of an angular rate"),
    ("psi[kg]", "column 'psi': kilogram is not the unit of an angle"),
    ("psi[N]", "column 'psi': newton is not the unit of an angle"),
    ("tau[Nm]", "newton metre is not the unit of a force"),
    ("tau[g]", "kilogram is not the unit of a force"),
    ("ax[G/s]", "unit 'G/s' is ambiguous"),
    ("n[m/s]", "m/s is not the unit of an angular rate"),
    ("rho[PSU]", "a plain number is not the unit of a density"),
    ("r[dge/s]", "unknown unit 'dge/s'; did you mean 'deg/s'"),
    ("r[nonsense]", "unknown unit 'nonsense'"),
    ("r[rad][s]", "has no column 'r'"),
]
ALL = ("delta_r", "tau", "n", "rho", "r", "psi", "ax")


def _run(folder: Path, header: str) -> Recording:
    headers = [*(name for name in ALL if name != header.partition("[")[0]), header]
    rows = ["t," + ",".join(headers), *(f"{t}" + ",3" * len(headers) for t in range(3))]
    (folder / "run.csv").write_text("\n".join(rows), encoding="utf-8")
    run = load(folder / "run.csv")
    check_units(VEHICLE.layout, [run])
    for name in ALL:
        run.column(name)
    return run


def _read(header: str, value: float) -> Case:
    def check(run: object) -> None:
        assert isinstance(run, Recording)
        assert math.isclose(run.column(header.partition("[")[0])[0], value, rel_tol=1e-12)

    return Case(f"unit: {header} is read", lambda folder: _run(folder, header), check=check)


def _beside(header: str) -> Case:
    def check(run: object) -> None:
        assert isinstance(run, Recording)
        assert set(ALL) <= set(run.columns)

    return Case(f"unit: {header} is beside", lambda folder: _run(folder, header), check=check)


def _refused(header: str, words: str) -> Case:
    return Case(f"unit: {header} is refused", lambda folder: _run(folder, header), ("run.csv", words))


CASES = [_read(*row) for row in READ] + [_beside(header) for header in BESIDE] + [_refused(*row) for row in REFUSED]
