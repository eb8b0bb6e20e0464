"""Vehicles: one model that simulation, likelihood, filters, diagnosis and controllers share."""

from .absorb import added_effects, with_coefficients
from .assembly import VehicleParts, build
from .base import AbstractVehicle, Layout
from .checks import numbers_that_may_vary, require_inertia
from .dimensions import check_units
from .from_python import own_model
from .gazebo import read_sdf, sdf_text
from .initial import InitialFile, initial_file, rig_file
from .like import published_file
from .mechanism import Mechanism
from .mss import read_mss
from .oddities import vehicle_findings
from .own import Model, OwnModel
from .read import read_vehicle, vehicle_from
from .sensors import Output, Sensors, quantities_of, recorded_columns
from .submerged_body import SubmergedBody
from .write import vehicle_text, write_vehicle

__all__ = [
    "AbstractVehicle",
    "InitialFile",
    "Layout",
    "Mechanism",
    "Model",
    "Output",
    "OwnModel",
    "Sensors",
    "SubmergedBody",
    "VehicleParts",
    "added_effects",
    "build",
    "check_units",
    "initial_file",
    "numbers_that_may_vary",
    "own_model",
    "published_file",
    "quantities_of",
    "read_mss",
    "read_sdf",
    "read_vehicle",
    "recorded_columns",
    "require_inertia",
    "rig_file",
    "sdf_text",
    "vehicle_findings",
    "vehicle_from",
    "vehicle_text",
    "with_coefficients",
    "write_vehicle",
]
