"""A vehicle's sensors as a file describes them: what each measures, how it is mounted, and how large its errors are."""

from .grades import GRADES, Grade
from .read import read_sensors, sensors_from
from .suite import KINDS, Motion, Sensor, SensorSuite

__all__ = ["GRADES", "KINDS", "Grade", "Motion", "Sensor", "SensorSuite", "read_sensors", "sensors_from"]
