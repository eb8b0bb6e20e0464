"""What a vehicle's sensors measure: outputs by channel, where they sit, and the form of their columns."""

from .output import RAW_UNITS, SPECIFIC_FORCE, Output, channel_unit, quantities_of
from .read import read_columns, read_outputs
from .sensors import Sensors, recorded_columns
from .write import column_entry, output_tables

__all__ = [
    "RAW_UNITS",
    "SPECIFIC_FORCE",
    "Output",
    "Sensors",
    "channel_unit",
    "column_entry",
    "output_tables",
    "quantities_of",
    "read_columns",
    "read_outputs",
    "recorded_columns",
]
