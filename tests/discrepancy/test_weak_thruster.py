"""Of an ROV's four thrusters the weak one is named, and none where all are as strong as the file says."""

import numpy as np
import pytest

from jaxsub.discrepancy import diagnose
from jaxsub.recording import Recording
from jaxsub.simulation import prbs, synthetic
from jaxsub.vehicle import vehicle_from

pytestmark = pytest.mark.long
# place and direction of each
THRUSTERS = {
    "t1": ([0.16, 0.11, 0.0], [1, -1, 0]), "t2": ([0.16, -0.11, 0.0], [1, 1, 0]),
    "t3": ([-0.16, 0.11, 0.0], [-1, -1, 0]), "t4": ([-0.16, -0.11, 0.0], [-1, 1, 0]),
}  # fmt: skip


def rov(**gains):
    """Surge, sway and yaw by four thrusters with the curves of a data sheet."""
    added = {"X_udot": -6.4, "Y_vdot": -7.1, "N_rdot": -0.22}
    drag = {"X_u": -13.7, "Y_v": -8.0, "N_r": -0.8, "X_u|u|": -141.0, "Y_v|v|": -217.0, "N_r|r|": -1.5}
    curve = {"kind": "thruster", "forward": 40.0, "reverse": 30.0}
    strong = {name: {"gain": gain} for name, gain in gains.items()}
    return vehicle_from(
        {
            "schema": 1, "name": "ROV", "kind": "submerged-body", "dof": ["surge", "sway", "yaw"],
            "body": {"mass": 13.5, "inertia": [0.26, 0.23, 0.37], "length": 0.46, "diameter": 0.3},
            "model": {"coriolis": "full"},
            "coefficients": {name: {"value": value, "fixed": True} for name, value in added.items()} | drag,
            "inputs": {name: {"column": name, "unit": "1"} for name in THRUSTERS},
            "actuators": {
                name: curve | {"position": place, "direction": towards} | strong.get(name, {})
                for name, (place, towards) in THRUSTERS.items()
            },
            "outputs": {name: {"sigma": 0.01} for name in ("u", "v", "r", "psi")},
        },
        "rov.toml",
    )  # fmt: skip


def recordings(truth, seed):
    times, blank = 0.1 * np.arange(400), dict.fromkeys(truth.layout.channels, np.full(400, np.nan))
    commands = lambda s, hold: 0.5 * prbs(400, hold, 1.0, s) + 0.3 * prbs(400, 40, 1.0, s + 500)
    columns = [
        {name: commands(1000 * seed + 10 * run + i, 15 + 3 * i) for i, name in enumerate(THRUSTERS)} for run in range(3)
    ]
    runs = [Recording(f"run{k}", times, blank | own, f"run{k}") for k, own in enumerate(columns)]
    return synthetic(truth, runs, seed=seed)


def test_thruster_that_is_a_fifth_weak_is_named():
    """Claim: that one alone, within three errors, with the whole vocabulary; unseen runs are then at their noise."""
    runs = recordings(rov(t3=0.8), 0)
    found, improved = diagnose(rov(), runs[:2], runs[2:])
    assert (found.verdict, [one.label for one in found.physics]) == ("named", ["actuator-gain[t3]"])
    size = found.physics[0].parameters["g"]
    assert abs(size.value + 0.2) < 3.0 * size.standard_error < 0.01
    held = found.fit["held_out"]
    assert max(held["improved"].values()) < 1.15 < max(held["baseline"].values())
    assert improved.fixed_gains == rov().fixed_gains


@pytest.mark.parametrize("seed", [0, 1])
def test_thrusters_as_strong_as_the_file_says_are_no_finding(seed):
    runs = recordings(rov(), seed)
    found, _ = diagnose(rov(), runs[:2], runs[2:])
    assert (found.verdict, found.physics) == ("none", [])


def test_weak_thruster_whose_gain_is_free_is_no_finding():
    """Claim: what the file's own free numbers can say is fitted, and named by no effect."""
    free = {name: {"value": 1.0, "free": True} for name in THRUSTERS}
    runs = recordings(rov(t3=0.8), 0)
    found, improved = diagnose(rov(**free), runs[:2], runs[2:])
    assert (found.verdict, found.physics) == ("none", [])
    assert abs(float(improved.values()["t3.gain"]) - 0.8) < 0.01
