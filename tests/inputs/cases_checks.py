"""Faults of sensors and clocks in recordings of a known vehicle: masked and said, cut and said, or refused."""

import dataclasses
import functools

import numpy as np
from corpus import Case
from rigs import driven, oscillator

from jaxsub.checks import check
from jaxsub.findings import require_none
from jaxsub.recording import load, save
from jaxsub.simulation import synthetic
from jaxsub.vehicle.catalogue import nps_auv_ii

VEHICLES = {"rig": oscillator, "auv": nps_auv_ii}


@functools.cache
def clean(kind, seed=3):
    vehicle = VEHICLES[kind]()
    inputs = driven(vehicle, 0.1 * np.arange(600), seed, 1.0 if kind == "rig" else 0.1)
    return vehicle, synthetic(vehicle, [inputs], seed=seed)[0]


def checked(folder, kind, fault, suffix="csv"):
    """The recordings as commands use them, after a way through a file."""
    vehicle, run = clean(kind)
    save(fault(run), folder / f"run.{suffix}")
    result = check(vehicle, [load(folder / f"run.{suffix}")])
    require_none(result.findings)
    return result


def column(name, change):
    """A fault of one column: `change(values)` gives the faulty ones."""

    def fault(run):
        return dataclasses.replace(run, columns=run.columns | {name: change(run.columns[name].copy())})

    return fault


def put(rows, value):
    def change(values):
        values[rows] = value
        return values

    return change


def rows_kept(keep):
    return lambda run: run.select(keep(len(run.times)))


def clocked(change):
    return lambda run: dataclasses.replace(run, times=change(run.times.copy()))


def masked(name, rows, word):
    """Just the faulty rows are missing, and a warning names channel and kind."""

    def verify(result):
        (run,) = result.recordings
        missing = np.isnan(run.column(name))
        assert missing[rows].all(), f"{missing[rows].sum()} of {missing[rows].size} masked"
        assert missing.sum() == np.zeros(len(missing), bool)[rows].size, "others are masked too"
        assert [f for f in result.findings if f.channel == name and f.check == word], result.findings

    return verify


def says(word, name=None):
    def verify(result):
        assert [f for f in result.findings if f.check == word and name in (None, f.channel)], result.findings

    return verify


def silent(result):
    assert not [f for f in result.findings if f.severity != "note" and f.check != "unstable"], result.findings


def in_pieces(count):
    def verify(result):
        assert len(result.recordings) == count
        assert any(f.check == "time-gap" for f in result.findings)

    return verify


def case(name, kind, fault, answer):
    make = functools.partial(checked, kind=kind, fault=fault)
    return Case(f"checks: {name}", make, *((answer,) if isinstance(answer, tuple) else ((), answer)))


STRETCH = slice(200, 260)
AT = [150]
SENTINELS = (-999.0, -9999.0, -32.768, 1e35, -99.9, 9999.0)

CASES = [
    *(case(f"clean {kind}", kind, lambda run: run, silent) for kind in VEHICLES),
    *(
        case(f"sentinel {value:g} in {name} of {kind}", kind, column(name, put(STRETCH, value)),
             masked(name, STRETCH, "sentinel"))
        for value in SENTINELS
        for kind, name in (("rig", "x"), ("auv", "r"))
    ),
    *(
        case(f"{name} of {kind} at zero for a while", kind, column(name, put(STRETCH, 0.0)), says("stuck", name))
        for kind, name in (("rig", "x"), ("rig", "x_rate"), ("auv", "v"), ("auv", "q"))
    ),
    *(
        case(f"{name} of {kind} stuck", kind, lambda run, name=name: column(
            name, put(STRETCH, run.columns[name][200]))(run), says("stuck", name))
        for kind, name in (("rig", "x"), ("auv", "r"), ("auv", "theta"))
    ),
    *(
        case(f"spike of {value:g} in {name} of {kind}", kind, column(name, put(AT, value)), masked(name, AT, word))
        for kind, name, value, word in (
            ("rig", "x", 40.0, "spike"), ("rig", "x_rate", -90.0, "spike"), ("auv", "v", 20.0, "spike"),
            ("auv", "r", 3.0, "spike"), ("auv", "z", 80.0, "spike"), ("auv", "u", 1e6, "impossible-value"),
        )
    ),
    case("clipped x of rig", "rig", column("x", lambda x: np.clip(x, -0.4, 0.4)), says("clipped", "x")),
    case("constant x_rate of rig", "rig", column("x_rate", put(slice(None), 0.1)), says("constant", "x_rate")),
    case("hole in time while the input moves", "rig", rows_kept(lambda n: (np.arange(n) < 200) | (np.arange(n) >= 300)),
         in_pieces(2)),
    case("input with a sentinel", "rig", column("f", put(STRETCH, -999.0)), ("'f'", "-999")),
    case("r in degrees read as radians", "auv", column("r", lambda r: np.rad2deg(r)), ("'psi'", "degrees")),
    case("r of reversed sign", "auv", column("r", np.negative), ("'psi'", "sign reversed", "r")),
    case("q of reversed sign", "auv", column("q", np.negative), ("'theta'", "sign reversed", "q")),
    case("psi in degrees read as radians", "auv", column("psi", lambda psi: np.rad2deg(psi) + 400.0), ("'psi'",)),
    case("u in mm/s", "auv", column("u", lambda u: 1000.0 * u), ("'u'",)),
    case("times in ms read as s", "rig", clocked(lambda t: 1e5 * t), ("s",)),
    case("late start of x of rig", "rig", column("x", put(slice(0, 100), np.nan)), says("late-start", "x")),
    case("slow x in fast rows", "rig", column("x", lambda x: np.repeat(x[::10], 10)), says("slow-sensor", "x")),
    case("psi late by 0.8 s", "auv", column("psi", lambda psi: np.concatenate([np.full(8, psi[0]), psi[:-8]])),
         says("delay", "psi")),
    case("idle rudder", "auv", column("delta_r", put(slice(None), 0.0)), says("input-at-rest")),
    case("quantised x", "rig", column("x", lambda x: np.round(x, 2)), silent),
    case("missing samples", "rig", column("x", put(slice(3, None, 7), np.nan)), silent),
    case("step of the input", "rig", column("f", lambda f: np.where(np.arange(len(f)) < 300, 0.0, f)), silent),
]  # fmt: skip
