"""Effects on sensors say of raw outputs what the keys of their tables say, in the column's own form and name."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxsub.effects import (
    Facts,
    SensorBias,
    SensorDrift,
    SensorLeverArm,
    SensorMisalignment,
    SensorRectification,
    SensorScale,
    candidates,
)
from jaxsub.vehicle import quantities_of, vehicle_from

RNG = np.random.default_rng(3)
STATE, TIMES = RNG.normal(size=(7, 12)), jnp.arange(7.0)
OUTPUTS = {
    "dvl": {"channel": ["u", "v"], "frame": "FLU"},
    "acc": {"channel": ["ax", "ay", "az"], "frame": "FLU"},
    "fix": {"channel": ["x", "y", "z"], "frame": "ENU"},
    "cell": {"channel": "pressure", "unit": "V", "scale": 1e-4},
    "compass": {"channel": "psi", "frame": "ENU"},
    "r": {},
}
ARMED = [
    ("dvl_u,dvl_v", "x"),
    ("dvl_u", "y"),
    ("acc_ax,acc_ay", "y"),
    ("acc_az", "x"),
    ("fix_x,fix_y", "x"),
    ("fix_z", "y"),
]


def boat(*effects, **changed):
    """A body with effects, and more keys in some of its tables."""
    tables = {name: table | changed.get(name, {}) for name, table in OUTPUTS.items()}
    body = {"mass": 30.0, "inertia": [1.0, 3.0, 3.0]}
    data = {"schema": 1, "name": "boat", "kind": "submerged-body", "body": body, "outputs": tables}
    return vehicle_from(data | {"coefficients": {"N_r": -5.0}, "effects": list(effects)}, "boat.toml")


def shown(vehicle):
    return dict(
        zip(
            vehicle.layout.channels,
            np.asarray(vehicle.measure(TIMES, jnp.asarray(STATE), jnp.zeros((7, 0)))).T,
            strict=True,
        )
    )


@pytest.mark.parametrize(("channels", "axis"), ARMED)
def test_lever_arm_of_an_effect_is_that_of_the_key(channels, axis):
    """Claim: in axes to port and in axes east, north and up the effect moves the sensor as `lever_arm` does."""
    arm = [0.3 * (axis == one) for one in "xyz"]
    effect = {"effect": "sensor-lever-arm", "channel": channels, "axis": axis, "parameters": {"arm": 0.3}}
    by_effect, by_key = shown(boat(effect)), shown(boat(**{channels.partition("_")[0]: {"lever_arm": arm}}))
    plain = shown(boat())
    assert any(not np.allclose(by_effect[channel], plain[channel]) for channel in channels.split(","))
    for channel in channels.split(","):
        np.testing.assert_allclose(by_effect[channel], by_key[channel], rtol=1e-12, atol=1e-12)


def test_misalignment_of_an_effect_is_the_mounting():
    """Claim: turned about the vertical, of axes to port with the other sign."""
    names = ("dvl_u", "dvl_v")
    effect = {"effect": "sensor-misalignment", "channel": ",".join(names), "sees": ",".join(names[::-1])}
    by_effect = shown(boat(effect | {"parameters": {"epsilon": -0.1}}))
    by_key = shown(boat(dvl={"mounting": [0.0, 0.0, 0.1]}))
    np.testing.assert_allclose([by_effect[n] for n in names], [by_key[n] for n in names], rtol=1e-12)


def test_units_of_effects_are_those_of_columns():
    effects = [{"effect": kind, "channel": "cell"} for kind in ("sensor-bias", "sensor-drift")]
    free = {row.name: row.unit for row in boat(*effects).layout.free}
    assert (free["sensor-bias[cell].bias"], free["sensor-drift[cell].drift"]) == ("V", "V/s")
    assert SensorBias("r").units() == {"bias": "rad/s"}


def test_candidates_are_of_outputs_by_their_names():
    """Claim: what a free number says is none, and the axes of one instrument are together."""
    layout = boat(dvl={"offset": {"value": 0.0, "free": True}}).layout
    facts = Facts(
        layout.kind, layout.equations, (), layout.channels, (), 1.0, 0.2, {}, 0.1,
        quantities=quantities_of(layout.outputs, True), has=frozenset({"dvl_u.offset", "dvl_v.offset", "cell.scale"}),
    )  # fmt: skip
    found = lambda kind: [e.label.partition("[")[2][:-1] for e in candidates(facts, (kind,))]
    assert found(SensorBias) == [c for c in layout.channels if not c.startswith("dvl")]
    assert found(SensorScale) == [c for c in layout.channels if c != "cell"]
    assert found(SensorDrift) == list(layout.channels)
    assert not {"fix_x", "fix_z", "cell", "dvl_u"} & set(found(SensorRectification))
    turned = [label for label in found(SensorMisalignment) if label.count(",") > 1]
    assert turned == [
        "dvl_u,dvl_v,dvl_v,dvl_u", "acc_ay,acc_az,acc_az,acc_ay", "acc_az,acc_ax,acc_ax,acc_az",
        "acc_ax,acc_ay,acc_ay,acc_ax",
    ]  # fmt: skip
    assert {"dvl_u,dvl_v,z", "fix_y,fix_x,fix_z,x", "acc_ax,acc_ay,acc_az,y"} <= set(found(SensorLeverArm))
