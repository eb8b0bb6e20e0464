"""Parameters of a vehicle as the Marine Systems Simulator has them: a MATLAB file of matrices to a vehicle."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..effects import EQUATIONS, STANDARD_DENSITY
from ..errors import InputError
from ..recording.matlab import read_structs
from .read import vehicle_from
from .submerged_body import SubmergedBody
from .usual_sensors import OUTPUTS

_FORCES, _RATES = "XYZKMN", "uvwpqr"
_KNOWN = ("MRB", "MA", "D", "Dn", "W", "B", "r_g", "r_b", "rho", "U", "T", "K")
# of the six equations those that matrices of three rows are for
_HORIZONTAL = (0, 1, 5)


def read_mss(path: str | Path) -> tuple[SubmergedBody, list[str]]:
    r"""The vehicle of the matrices in the MATLAB file `path`, and which of its variables it lacks.

    $(M_{RB} + M_A)\dot\nu + (C_{RB} + C_A)\nu + D\nu + D_n|\nu|\nu + g(\eta) = TKu$ (Fossen 2021): `MRB`, `MA`, `D` and
    `Dn` are (6, 6), or (3, 3) for surge, sway and yaw; `W` and `B` are N, `r_g` and `r_b` (3,) m, and g that of MSS's
    `gvect`; `rho` is the density and `U` the operating speed; `T` is (6, m), and `K` (m,) or (m, m), diagonal. They are
    at the top of the file, or fields of its one struct that has them. C is that of `m2c`. SI, about the origin, z down.

    **Raises** `InputError` for what is no such file, and for matrices that do not go together.
    """
    path = Path(path)
    where = str(path)
    values = _variables(read_structs(path, where), where)
    rows = _rows(values, where)
    read = lambda key, shape: _array(values, key, shape, where)
    rigid, added = read("MRB", (len(rows), len(rows))), read("MA", (len(rows), len(rows)))
    if rigid is None:
        raise InputError(f"{where}: MRB", "is missing", "save the rigid-body matrix as MRB")
    data: dict[str, Any] = {"schema": 1, "name": path.stem, "kind": "submerged-body", "outputs": OUTPUTS}
    data["body"], lost = _body(rigid, rows, values, where)
    data["model"] = {"coriolis": "full"}
    if len(rows) < len(EQUATIONS):
        data["dof"] = [EQUATIONS[row] for row in rows]
        data["outputs"] = {name: OUTPUTS[name] for name in ("u", "v", "r", "psi")}
    fixed = lambda value: {"value": value, "fixed": True}
    data["coefficients"] = {name: fixed(v) for name, v in _derivatives(added, rows, "{0}_{1}dot").items()}
    data["coefficients"] |= _derivatives(read("D", rigid.shape), rows, "{0}_{1}")
    data["coefficients"] |= _derivatives(read("Dn", rigid.shape), rows, "{0}_{1}|{1}|")
    _add_inputs(data, values, rows, where)
    lost += [name for name in values if name not in _KNOWN]
    vehicle = vehicle_from(data, where)
    assert isinstance(vehicle, SubmergedBody)
    return vehicle, lost


def _variables(found: Mapping[str, Any], where: str) -> Mapping[str, Any]:
    """The variables with the rigid-body matrix: of the file, or of a struct in it."""
    for values in (found, *(one for one in found.values() if isinstance(one, Mapping))):
        if "MRB" in values:
            return values
    raise InputError(where, "has no matrix MRB", "save M_RB, M_A, D and the like as MRB, MA, D, or give an SDF file")


def _rows(values: Mapping[str, Any], where: str) -> tuple[int, ...]:
    """The equations for which the matrices are."""
    shape = np.shape(values["MRB"])
    if shape not in ((6, 6), (3, 3)):
        said = " by ".join(map(str, shape)) or "one number"
        raise InputError(f"{where}: MRB", f"is {said}", "give a matrix (6, 6), or (3, 3) for surge, sway and yaw")
    return tuple(range(6)) if shape == (6, 6) else _HORIZONTAL


def _array(values: Mapping[str, Any], key: str, shape: tuple[int, ...], where: str) -> np.ndarray | None:
    """The variable `key` as finite numbers of that `shape`; None where there is none."""
    if key not in values:
        return None
    try:
        array = np.asarray(values[key], float)
    except (TypeError, ValueError) as error:
        raise InputError(f"{where}: {key}", "is no array of numbers", "save numbers") from error
    if array.shape != shape or not np.all(np.isfinite(array)):
        said = " by ".join(map(str, array.shape)) or "one number"
        what = f"is {said}" if array.shape != shape else "has numbers that are not finite"
        raise InputError(f"{where}: {key}", what, f"give {' by '.join(map(str, shape)) or 'one number'}")
    return array


def _body(
    rigid: np.ndarray, rows: tuple[int, ...], values: Mapping[str, Any], where: str
) -> tuple[dict[str, Any], list[str]]:
    """`[body]` of the rigid-body matrix, and what of it there is no place for."""
    full = np.zeros((6, 6))
    full[np.ix_(rows, rows)] = rigid
    mass = float(full[0, 0])
    centre = np.array([full[1, 5], -full[0, 5], full[0, 4]]) / mass
    if (given := _array(values, "r_g", (3,), where)) is not None:
        if not np.allclose(given[:2], centre[:2], atol=1e-6) or (len(rows) == 6 and abs(given[2] - centre[2]) > 1e-6):
            said = ", ".join(f"{value:.4g}" for value in centre)
            raise InputError(f"{where}: r_g", f"is not the centre of gravity of MRB, {said}", "mend one of them")
        centre = given
    turned = [float(full[i, i]) or mass for i in (3, 4, 5)]
    body: dict[str, Any] = {"mass": mass, "inertia": turned, "centre_of_gravity": centre.tolist()}
    for key, name in (("W", "weight"), ("B", "buoyancy"), ("U", "speed"), ("rho", "reference_density")):
        if (number := _array(values, key, (), where)) is not None:
            body[name] = float(number)
    if (buoyant := _array(values, "r_b", (3,), where)) is not None:
        body["centre_of_buoyancy"] = buoyant.tolist()
    elif len(rows) == 6:
        body["centre_of_buoyancy"] = centre.tolist()
    body.setdefault("reference_density", STANDARD_DENSITY)
    apart = full[3:, 3:] - np.diag(np.diag(full[3:, 3:]))
    if np.abs(apart).max() > 1e-9 * np.abs(full[3:, 3:]).max():
        said = ", ".join(f"{value:.4g}" for value in apart[np.triu_indices(3, 1)])
        return body, [f"products of inertia in MRB, {said} kg m²"]
    return body, []


def _derivatives(matrix: np.ndarray | None, rows: tuple[int, ...], form: str) -> dict[str, float]:
    """Derivatives by SNAME of a `matrix` of the left-hand side, whose signs are the opposite."""
    if matrix is None:
        return {}
    places = zip(*np.nonzero(matrix), strict=True)
    return {form.format(_FORCES[rows[i]], _RATES[rows[j]]): -float(matrix[i, j]) for i, j in places}


def _add_inputs(data: dict[str, Any], values: Mapping[str, Any], rows: tuple[int, ...], where: str) -> None:
    """Inputs `u1`, `u2` and so on, with their forces by the thrust configuration."""
    if "T" not in values:
        return
    count = np.asarray(values["T"]).size // len(rows)
    shaped = np.shape(values["T"])
    configuration = _array(values, "T", shaped if len(shaped) == 1 else (len(rows), count), where)
    assert configuration is not None
    forces = configuration.reshape(len(rows), count)
    names = [f"u{index}" for index in range(1, count + 1)]
    gain = np.atleast_1d(np.asarray(values.get("K", np.ones(count)), float))
    diagonal = np.diag(gain) if gain.ndim == 2 else gain
    if diagonal.shape != (count,) or (gain.ndim == 2 and np.count_nonzero(gain - np.diag(diagonal))):
        raise InputError(f"{where}: K", "is not diagonal or not of the size of T", f"give {count} numbers")
    data["inputs"] = {name: name for name in names}
    data["actuators"] = {name: {"kind": "generic"} for name in names}
    for name, column in zip(names, (forces * diagonal).T, strict=True):
        acting = {f"B_{EQUATIONS[row]}_{name}": float(value) for row, value in zip(rows, column, strict=True) if value}
        data["coefficients"] |= acting
