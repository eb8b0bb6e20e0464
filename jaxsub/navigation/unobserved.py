"""What the sensors of a log cannot say of the motion, in sentences."""

import math

import numpy as np

from .navigate import Navigation

# share of what was known beforehand that must be left of a bias's deviation for it to count as not estimated
_KEPT = 0.7
# rad and m beyond which an angle or a place is called unknown
_UNSURE, _FAR = math.radians(5.0), 10.0


def unobserved(found: Navigation) -> list[str]:
    """What the filter could not tell, and which sensor or motion would."""
    suite, std = found.suite, found.smoothed.motion_std
    fixes = [sensor.name for sensor in suite.of("gps", "usbl") if found.rows.used[sensor.name]]
    said = [*_of_heading(found)]
    if not fixes:
        bounded = " but for the motion's reach, which the file states" if math.isfinite(suite.motion.reach) else ""
        said.append(f"No sensor fixes the position north and east{bounded}: x and y count from where the log begins.")
    if not suite.of("pressure", "depth") and not any("z" in s.channels or "altitude" in s.channels
                                                     for s in suite.of("gps", "usbl")):  # fmt: skip
        said.append("No sensor measures depth: z counts from where the log begins.")
    drift = float(np.max(std[:, 6:8]))
    if drift > _FAR:
        at = float(found.log.times[int(np.argmax(std[:, 6:8].max(axis=1)))])
        said.append(f"The horizontal position is uncertain by up to {drift:.3g} m (1 σ), most at t = {at:.4g} s.")
    return said + _of_constants(found)


def _of_heading(found: Navigation) -> list[str]:
    std = found.smoothed.motion_std[:, 2]
    if found.start.heading == "relative":
        end = math.degrees(float(std[-1]))
        return [
            "No sensor shows where north is: yaw counts from the start of the log"
            f" and is uncertain by {end:.2g}° (1 σ) at its end."
        ]
    median = float(np.median(std))
    if median > _UNSURE:
        moving = "turning or accelerating while fixes are taken would show it"
        remedy = moving if found.start.heading in ("unknown", "by fixes") else "a calibrated compass would show it"
        return [f"Yaw is uncertain by {math.degrees(median):.2g}° (1 σ, median): {remedy}."]
    return []


def _of_constants(found: Navigation) -> list[str]:
    """Biases and scale errors that are as uncertain at the end as they were at the start."""
    said = []
    first, after = found.start.std[9:18], found.smoothed.constants_std[-1]
    parts = (("gyro biases", 0), ("accelerometer biases", 3), ("gyro scale errors", 6))
    remedies = ("a fix of the heading", "turning about level axes", "turns")
    for (name, at), remedy in zip(parts, remedies, strict=True):
        kept = [axis for axis, i in zip("xyz", range(at, at + 3), strict=True) if after[i] > _KEPT * first[i]]
        if kept:
            said.append(f"The {name} about {', '.join(kept)} are as uncertain as beforehand; {remedy} would show them.")
    return said
