"""Published vehicles: the files in `published`, which hold the publications' numbers and name their sources."""

from pathlib import Path

from .read import read_vehicle
from .submerged_body import SubmergedBody


def nps_auv_ii() -> SubmergedBody:
    """NPS AUV II (L = 5.3 m) of Healey and Lienard (1993), six degrees of freedom, linearised at 1.832 m/s."""
    return _published("nps_auv_ii")


def remus_100() -> SubmergedBody:
    """REMUS 100 of Prestero (2001), six degrees of freedom, linearised at 1.54 m/s; unstable in open loop."""
    return _published("remus_100_linear")


def remus_100_nonlinear() -> SubmergedBody:
    """REMUS 100 with the nonlinear derivatives of Prestero (2001), six degrees of freedom."""
    return _published("remus_100")


def bluerov2_heavy() -> SubmergedBody:
    """BlueROV2 Heavy of von Benzon et al. (2022), six degrees of freedom and eight thrusters."""
    return _published("bluerov2_heavy")


def kvlcc2() -> SubmergedBody:
    """The KVLCC2 tanker's 7 m model by the MMG method of Yasukawa and Yoshimura (2015)."""
    return _published("kvlcc2")


def dsrv() -> SubmergedBody:
    """Deep Submergence Rescue Vehicle of Healey (1992), heave and pitch, linearised at 4.11 m/s."""
    return _published("dsrv")


def otter() -> SubmergedBody:
    """Otter USV of Fossen's simulators, in surge, sway and yaw, with two propellers."""
    return _published("otter")


def suboff() -> SubmergedBody:
    """DARPA SUBOFF with all appendages by the experiments of Roddy (1990), in surge, heave and pitch."""
    return _published("suboff")


def seaglider() -> SubmergedBody:
    """Seaglider by the flight model of Eriksen et al. (2001), surge and heave at the recorded pitch and roll."""
    return _published("seaglider")


def slocum() -> SubmergedBody:
    """Slocum glider of Graver (2005), in surge, heave and pitch, with ballast and a mass that moves."""
    return _published("slocum")


def torpedo() -> SubmergedBody:
    """Torpedo of Fossen's simulators, six degrees of freedom, with four fins and a propeller."""
    return _published("torpedo")


def rexrov() -> SubmergedBody:
    """RexROV, a work-class ROV by the numbers of Berg (2012), with eight thrusters and a tether."""
    return _published("rexrov")


def _published(name: str) -> SubmergedBody:
    vehicle = read_vehicle(Path(__file__).parent / "published" / f"{name}.toml")
    assert isinstance(vehicle, SubmergedBody)
    return vehicle
