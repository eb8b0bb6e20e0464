"""A vehicle watched on line: changes of its innovations, with a stated rate of false alarms."""

from .calibration import Calibration, Tail, calibrated
from .lines import Lines
from .monitor import AlarmTest, Monitor, MonitorState, Observation
from .setup import WatchedModel, initial_state, model_by_noise, model_of, monitor_of, rows_of
from .signatures import Signatures
from .sources import is_file, lines_of
from .watcher import Watcher

__all__ = [
    "AlarmTest",
    "Calibration",
    "Lines",
    "Monitor",
    "MonitorState",
    "Observation",
    "Signatures",
    "Tail",
    "WatchedModel",
    "Watcher",
    "calibrated",
    "initial_state",
    "is_file",
    "lines_of",
    "model_by_noise",
    "model_of",
    "monitor_of",
    "rows_of",
]
