"""What a fit that does not fit says of its coefficients: a hole, a dead sensor and spikes leave none identified."""

import dataclasses

import numpy as np
import pytest

from jaxsub.estimate import assess, fit
from jaxsub.information import coloured_covariance, estimates, identifiability
from jaxsub.recording import Recording
from jaxsub.simulation import prbs, synthetic
from tests.rigs import oscillator, stacked

DT, SAMPLES = 0.1, 1200


def steering(sigma=0.01):
    """Sway and yaw with a rudder: v and r measured."""
    known = {"I_sway": {"value": 1.0, "fixed": True}, "I_yaw": {"value": 1.0, "fixed": True}}
    values = {"D_sway": 1.5, "D_yaw": 2.0, "D_sway_yaw": 0.4, "B_yaw_rudder": 1.5, "B_sway_rudder": -0.3}
    outputs = {"sway_rate": {"sigma": sigma}, "yaw_rate": {"sigma": sigma}}
    return oscillator(
        name="steering", dof=["sway", "yaw"], coefficients=known | values, inputs={"rudder": "dr"}, outputs=outputs
    )


def log():
    """A recording of the steering model: 120 s, the rudder moving."""
    columns = {name: np.full(SAMPLES, np.nan) for name in steering().layout.channels}
    columns["dr"] = prbs(SAMPLES, 15, 0.3, 0)
    asked = Recording("log", DT * np.arange(SAMPLES), columns, "log")
    return synthetic(steering(), [asked], seed=0)[0]


def with_columns(recording, rows=slice(None), **columns):
    kept = {name: np.array(column)[rows] for name, column in (recording.columns | columns).items()}
    return Recording(recording.name, recording.times[rows], kept, recording.source)


def hole(recording):
    """10 s without rows, the rudder held at its last value across them."""
    rudder = recording.columns["dr"]
    first = next(row for row in range(300, SAMPLES) if rudder[row - 1] != rudder[row + 99])
    return with_columns(recording, np.r_[0:first, first + 100 : SAMPLES])


def dead(recording):
    """A speed log that wrote zeros for half of the run."""
    v = np.array(recording.columns["sway_rate"])
    v[400:1000] = 0.0
    return with_columns(recording, sway_rate=v)


def spikes(recording):
    """Two values of 50 m/s."""
    v = np.array(recording.columns["sway_rate"])
    v[[500, 800]] = 50.0
    return with_columns(recording, sway_rate=v)


def told(recording, sigma):
    found = fit(steering(sigma), stacked(steering(sigma), [recording]))
    return found, assess(found), identifiability(found)


@pytest.mark.parametrize("sigma", [0.01, "estimate"])
@pytest.mark.parametrize("damage", [hole, *(pytest.param(d, marks=pytest.mark.long) for d in (dead, spikes))])
def test_no_coefficient_of_a_damaged_log_is_identified(damage, sigma):
    """Claim: whether σ is given or estimated, the fit does not explain the runs and nothing counts as identified."""
    found, assessment, said = told(damage(log()), sigma)
    assert not assessment.explains
    assert "identified" not in {verdict.kind for verdict in said.verdicts}
    assert not any("identified, known" in line for line in said.sentences())
    assert all(word not in assessment.verdict() for word in ("nan", "inf "))
    assert all(estimate.verdict != "identified" for estimate in estimates(found, said, None))


@pytest.mark.parametrize("sigma", [0.01, "estimate"])
def test_coefficients_of_the_log_itself_are_identified(sigma):
    """Claim: the same log without damage is explained and identifies every coefficient."""
    _, assessment, said = told(log(), sigma)
    assert assessment.explains
    assert {verdict.kind for verdict in said.verdicts} == {"identified"}


def test_errors_allow_for_residuals_that_are_too_large():
    """Claim: with σ given five times too small the main standard error is about five times the white one."""
    found = fit(steering(0.002), stacked(steering(0.002), [log()]))
    for estimate in estimates(found, identifiability(found), coloured_covariance(found)):
        assert 3.0 < estimate.standard_error / estimate.standard_error_white < 10.0


def test_what_slow_forces_hide_is_not_identified():
    """Claim: a standard error above half the size is never called identified, also where white residuals told more."""
    found = fit(steering(), stacked(steering(), [log()]))
    said, coloured = identifiability(found), coloured_covariance(found)
    assert {one.verdict for one in estimates(found, said, coloured)} == {"identified"}
    # of one coefficient, in the middle of its interval for white residuals and beyond
    at = found.names.index("D_yaw")
    for share, verdict in ((0.45, "identified"), (0.55, "identified only if residuals were white")):
        wide = coloured.covariance.at[at, at].set((share * found.values["D_yaw"]) ** 2)
        by_name = {e.name: e for e in estimates(found, said, dataclasses.replace(coloured, covariance=wide))}
        assert by_name["D_yaw"].verdict == verdict
        assert {e.verdict for name, e in by_name.items() if name != "D_yaw"} == {"identified"}


def test_a_coefficient_at_its_bound_has_no_error_and_others_hold_with_it_there():
    """Claim: at its lower bound there is no standard error; others' are those of a fit in which it is fixed there."""
    recording = log()

    def with_damping(entry):
        vehicle = steering()
        data = {"I_sway": {"value": 1.0, "fixed": True}, "I_yaw": {"value": 1.0, "fixed": True}}
        data |= {"D_sway": 1.5, "D_yaw": entry, "D_sway_yaw": 0.4, "B_yaw_rudder": 1.5, "B_sway_rudder": -0.3}
        return oscillator(
            name="steering",
            dof=["sway", "yaw"],
            coefficients=data,
            inputs={"rudder": "dr"},
            outputs={output.channel: {"sigma": 0.01} for output in vehicle.layout.outputs},
        )

    bounded = with_damping({"value": 2.5, "bounds": [2.3, 20.0]})
    found = fit(bounded, stacked(bounded, [recording]))
    assert found.at_bound == {"D_yaw": "lower"}
    by_name = {e.name: e for e in estimates(found, identifiability(found), coloured_covariance(found))}
    assert by_name["D_yaw"].verdict == "at its lower bound" and by_name["D_yaw"].standard_error is None
    held = with_damping({"value": found.values["D_yaw"], "fixed": True})
    other = fit(held, stacked(held, [recording]))
    for name, error in other.standard_errors.items():
        assert by_name[name].standard_error_white == pytest.approx(error, rel=0.02)
