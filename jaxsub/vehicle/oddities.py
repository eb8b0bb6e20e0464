"""What is odd about a vehicle that can be simulated all the same: numbers and names that change nothing, and some that
no rigid body has."""

from collections.abc import Iterator

from ..effects import EQUATIONS, GRAVITY, VELOCITIES, ActuatorGain, derivative
from ..findings import Finding
from .base import AbstractVehicle, Layout
from .checks import inputs_of
from .initial import begun
from .mechanism import Mechanism
from .own import OwnModel
from .products import derivatives
from .submerged_body import CURRENT, SubmergedBody

_FAR = 4.0  # standard deviations from an estimate by the geometry; published vehicles lie within three
_TOLERANCE = 0.01  # of an inertia or a weight: such numbers are given to two or three digits


def vehicle_findings(vehicle: AbstractVehicle, where: str) -> tuple[Finding, ...]:
    """Warnings and notes about `vehicle`, of the file `where`.

    A body's inertia that breaks the triangle inequality, a weight that is not mass times gravity, coefficients of
    locked degrees of freedom, actuators that move nothing; of a mechanism a coupling that stands for both directions.
    """
    found: list[Finding] = []
    if isinstance(vehicle, SubmergedBody):
        found += _rigid(vehicle, where)
        found += _locked(vehicle, where)
        found += _twice(vehicle, where)
        found += _converted(vehicle, where)
        found += _unlike_geometry(vehicle, where)
    if isinstance(vehicle, Mechanism):
        found += _couplings(vehicle, where)
    return (*found, *_idle(vehicle, where))


def _rigid(body: SubmergedBody, where: str) -> Iterator[Finding]:
    inertia = {name: float(body.inertia.rigid[name]) for name in ("I_x", "I_y", "I_z")}
    largest = max(inertia, key=lambda name: inertia[name])
    others = [name for name in inertia if name != largest]
    total = sum(inertia[name] for name in others)
    if inertia[largest] > (1.0 + _TOLERANCE) * total:
        what = (
            f"{largest} = {inertia[largest]:g} kg m² exceeds {' + '.join(others)} = {total:g} kg m² as in no rigid body"
        )
        remedy = "check the numbers; added inertia belongs to K_pdot, M_qdot and N_rdot"
        yield Finding("inertia-triangle", "warning", f"{where}: body.inertia", what, remedy)
    weight, mass = float(body.restoring.values["weight"]), float(body.inertia.rigid["mass"])
    if abs(weight / (mass * GRAVITY) - 1.0) > _TOLERANCE:
        what = f"{weight:g} N is not mass times gravity, {mass * GRAVITY:g} N"
        yield Finding("weight", "warning", f"{where}: body.weight", what, "give the weight in N, or leave it out")


def _locked(body: SubmergedBody, where: str) -> Iterator[Finding]:
    without = [name for name in body.own_values() if not _acts(name, body.layout)]
    if without:
        free = ", ".join(body.layout.equations)
        what = f"{', '.join(without)} act on or through locked degrees of freedom, so they change nothing"
        yield Finding("locked", "warning", f"{where}: coefficients", what, f"delete them or free more in dof: {free}")


def _twice(body: SubmergedBody, where: str) -> Iterator[Finding]:
    for effect in body.effects:
        if effect.term in body.has:
            said = "[model] coriolis" if effect.term == "coriolis" else f"the coefficient {effect.term}"
            what = f"says what {said} says, so no recording can tell them apart"
            yield Finding("said-twice", "warning", f"{where}: effects ({effect.label})", what, "delete one")
        if isinstance(effect, ActuatorGain) and effect.actuator not in body.fixed_gains:
            what = f"scales the force of {effect.actuator}, as free numbers do, so no recording can tell them apart"
            yield Finding("said-twice", "warning", f"{where}: effects ({effect.label})", what, "delete it or fix those")
    for name, term in derivatives(body.own_values()).items():
        if term.name in body.actuators.names:
            devices = [one.name for one in body.actuators.items if set(term.inputs) & set(dict(one.input))]
            what = f"acts beside [actuators.{'], [actuators.'.join(devices)}], whose force it adds to"
            yield Finding(
                "said-twice", "warning", f"{where}: coefficients.{name}", what, "delete it if both are the same"
            )


def _converted(body: SubmergedBody, where: str) -> Iterator[Finding]:
    values = body.own_values()
    terms = derivatives(values) if body.layout.system else {}
    for equation in EQUATIONS:
        own = [f"{n} = {float(values[n]):.6g} {term.unit}" for n, term in terms.items() if term.equation == equation]
        if own:
            what = f"of {equation} in SI, from the {body.layout.system}: {', '.join(own)}"
            yield Finding("non-dimensional", "note", f"{where}: coefficients", what)


def _unlike_geometry(body: SubmergedBody, where: str) -> Iterator[Finding]:
    """Coefficients that lie far from what is estimated from the geometry that the file states."""
    if body.layout.geometry is None:
        return
    file, values = begun(body.layout.geometry), body.own_values()
    same = file.tables["model"]["coriolis"][0].strip('"') == body.coriolis
    for name, estimate in file.coefficients.items():
        term = derivative(name)
        # what Coriolis forces hold is among products of two velocities, or not, as [model] says
        if name not in values or term is None or not (same or term.rate or "|" in name):
            continue
        value = float(values[name])
        off = abs(value - estimate.value) / estimate.std
        if off > _FAR:
            what = f"is {value:.4g} {term.unit}, {off:.1f} standard deviations from {estimate.value:.4g}"
            what += f" ± {estimate.std:.2g}, the estimate by the geometry ({estimate.source})"
            remedy = "check its sign and unit, or the dimensions of geometry"
            yield Finding("geometry", "warning", f"{where}: coefficients.{name}", what, remedy)


def _acts(name: str, layout: Layout) -> bool:
    """Whether a body's number can change its motion; those of `[body]` all can."""
    if (term := derivative(name)) is None:
        return True
    moved = {*layout.equations, *(e for e, v in VELOCITIES.items() if v in dict(layout.prescribed))}
    if term.rate:  # accelerations of prescribed motions are neglected
        moved = set(layout.equations)
    elif not term.linear:  # a product with the speed of a body that is locked in surge
        moved.add("surge")
    if set(CURRENT) & set(dict(layout.environment)) and not term.rate:
        moved |= set(EQUATIONS[:3])
    return term.equation in layout.equations and set(term.moved) <= moved


def _idle(vehicle: AbstractVehicle, where: str) -> Iterator[Finding]:
    if isinstance(vehicle, OwnModel):  # whose equations may do anything with an input
        return
    layout, named = vehicle.layout, {word for effect in vehicle.effects for word in inputs_of(effect)}
    for actuator, _ in layout.inputs:
        if actuator in named or (
            _drives(vehicle, actuator) if isinstance(vehicle, Mechanism) else _pushes(vehicle, actuator)
        ):
            continue
        what = "moves nothing: no coefficient or effect acts through it on a free degree of freedom"
        remedy = "give its coefficient, or delete the line"
        yield Finding("idle-input", "warning", f"{where}: inputs.{actuator}", what, remedy)


def _drives(vehicle: Mechanism, actuator: str) -> bool:
    return any(f"B_{equation}_{actuator}" in vehicle.coefficients for equation in vehicle.layout.equations)


def _pushes(vehicle: AbstractVehicle, actuator: str) -> bool:
    if isinstance(vehicle, SubmergedBody) and _moves(vehicle, actuator):
        return True
    if actuator == "thrust":
        return "surge" in vehicle.layout.equations
    acting = [term for name, term in derivatives(vehicle.own_values()).items() if _acts(name, vehicle.layout)]
    return any(actuator in way for term in acting for way in term.needs())


def _moves(body: SubmergedBody, name: str) -> bool:
    """Whether an input commands an actuator that acts on a free degree of freedom."""
    free = set(body.layout.equations)
    return any(name in dict(item.input) and free & set(item.acts_on()) for item in body.actuators.items)


def _couplings(mechanism: Mechanism, where: str) -> Iterator[Finding]:
    names, coefficients = mechanism.layout.equations, mechanism.coefficients
    for letter in "DK":
        for one in names:
            for other in names:
                name, mirrored = f"{letter}_{one}_{other}", f"{letter}_{other}_{one}"
                if one != other and name in coefficients and mirrored not in coefficients:
                    what = f"acts on {one} and, as {mirrored}, on {other}"
                    remedy = f"write {mirrored} = {{ value = 0, fixed = true }} where it acts on {one} alone"
                    yield Finding("coupling", "note", f"{where}: coefficients.{name}", what, remedy)
