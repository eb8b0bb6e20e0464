"""Which run would settle what the recordings leave open."""

from ..records.diagnosis import Physics, Verdict

_RUNS = {
    frozenset({"propeller-torque", "trim-offset", "hull-asymmetry"}): (
        "two steady runs at shaft speeds a factor of two apart and one at a steady pitch of 20°: a propeller's torque "
        "follows the shaft speed, a trim offset the attitude, an asymmetry neither"
    ),
    frozenset({"actuator-lag", "actuator-delay"}): (
        "single steps of the actuator held for at least ten time constants, sampled five times as fast: a lag bends, a "
        "delay does not"
    ),
    frozenset({"actuator-gain", "actuator-deadband", "actuator-backlash", "actuator-saturation"}): (
        "steps of the actuator at a tenth, a third and all of its range: a gain takes the same share of each, a dead "
        "band or play the same amount, a stop only the top"
    ),
    frozenset({"quadratic-damping", "cubic-damping", "crossflow-drag"}): (
        "the same manoeuvre at a third and at three times the amplitude, and one with sway and yaw (or "
        "heave and pitch) in "
        "another ratio, such as a pull-out instead of a zigzag"
    ),
    frozenset({"hull-compressibility", "density-stratification", "thermal-expansion", "buoyancy-error"}): (
        "the same dive with recorded density and temperature, or in well-mixed water: the hull's share "
        "follows pressure, the "
        "water's follows density"
    ),
    frozenset({"sensor-bias", "sensor-scale", "sensor-drift"}): (
        "a minute at rest before and after a run: a bias shows at rest, a scale does not, a drift "
        "differs between the two"
    ),
}


def next_manoeuvre(verdict: Verdict, physics: list[Physics]) -> str | None:
    """The run that best separates what was named from its rivals; None where nothing is ambiguous."""
    if verdict != "ambiguous":
        return None
    names = {found.effect for found in physics} | {rival.effect for found in physics for rival in found.rivals}
    best = max(_RUNS, key=lambda group: len(group & names))
    if len(best & names) > 1:
        return _RUNS[best]
    return f"a run that excites {' and '.join(sorted(names))} apart from each other, at twice the amplitude of these"
