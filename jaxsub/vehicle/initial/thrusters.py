"""Thrusters of an ROV or a catamaran in the arrangements that are usual."""

import math
from collections.abc import Collection, Sequence

import numpy as np

from .columns import Columns, Command
from .file import Estimate, InitialFile, number, vector

_WORDS = r"(?:t|m|c|n|u|rc|ch|thr|thrust|thruster|motor|esc|prop|servo|output)?_?\d+"
# pulse widths of hobby electronics, µs: standing still, and how far from it they go
_NEUTRAL, _SWING = 1500.0, 400.0
_ACROSS = math.sqrt(0.5)

# places as parts of length, beam and height, and directions
Arrangement = Sequence[tuple[tuple[float, float, float], tuple[float, float, float]]]


def vectored() -> Arrangement:
    """Four horizontal thrusters at the corners, turned by 45° as those of the BlueROV2 are."""
    corners = [(1, 1), (1, -1), (-1, 1), (-1, -1)]
    return [((0.3 * x, 0.3 * y, 0.0), (x * _ACROSS, -y * _ACROSS, 0.0)) for x, y in corners]


def vertical(count: int) -> Arrangement:
    """`count` vertical thrusters that push up: one amidships, two on the sides, or four at the corners."""
    places = {1: [(0, 0)], 2: [(0, 1), (0, -1)], 4: [(1, 1), (1, -1), (-1, 1), (-1, -1)]}[count]
    return [((0.3 * x, 0.4 * y, 0.0), (0.0, 0.0, -1.0)) for x, y in places]


def twin() -> Arrangement:
    """Two that push ahead, one on each side."""
    return [((-0.4, 0.4 * y, 0.0), (1.0, 0.0, 0.0)) for y in (-1, 1)]


# by their number: as the BlueROV2 Heavy, the BlueROV2, and vehicles of fewer
ARRANGEMENTS: dict[int, Arrangement] = {
    8: [*vectored(), *vertical(4)],
    6: [*vectored(), *vertical(2)],
    5: [*vectored(), *vertical(1)],
    4: [*twin(), *vertical(1), ((0.0, 0.0, 0.0), (0.0, 1.0, 0.0))],
    3: [*twin(), *vertical(1)],
    2: twin(),
}


def numbered(columns: Columns, counts: Collection[int]) -> list[Command]:
    """The commands of numbered thrusters in a log, as many as the largest of `counts` that there are."""
    found: list[Command] = []
    while command := columns.take(_WORDS, []):
        found.append(command)
    count = max((n for n in counts if n <= len(found)), default=0)
    columns.put_back(found[count:])
    return found[:count]


def put_thrusters(
    file: InitialFile,
    arrangement: Arrangement,
    names: Sequence[str],
    commands: Sequence[Command],
    box: tuple[float, float, float],
    largest: float,
) -> None:
    """Thrusters of those `names` in an `arrangement` about a vehicle of the lengths `box` (m).

    With the largest of `commands` each pushes with the force `largest` (N), by the square of the command; without
    commands the inputs are forces. All are of one make, and follow the first.
    """
    for index, ((place, direction), name) in enumerate(zip(arrangement, names, strict=True)):
        at = vector(*(part * size for part, size in zip(place, box, strict=True)))
        keys = [f'kind = "thruster", position = {at}, direction = {vector(*direction)}']
        command = commands[index] if commands else None
        file.put("inputs", name, f'{{ column = "{name}", unit = "N" }}' if command is None else command.toml)
        keys += _curve(command, commands, largest, "" if index == 0 else names[0])
        file.put("actuators", name, f"{{ {', '.join(keys)} }}")


def _curve(command: Command | None, commands: Sequence[Command], largest: float, like: str) -> list[str]:
    """Keys that make a force of a command, those of the thruster `like` where there is one."""
    if command is None or command.unit == "N":
        return [f'gain = "{like}.gain"' if like else f"gain = {Estimate(1.0, 0.1).toml(free=True)}"]
    middle = _neutral(commands)
    swing = _SWING if middle else max(one.largest for one in commands)
    force = Estimate.within(1.0, largest / swing**2).toml(free=True)
    keys = [f'forward = "{like}.forward"' if like else f"forward = {force}"]
    return [*keys, f"neutral = {number(middle)}"] if middle else keys


def _neutral(commands: Sequence[Command]) -> float:
    """The command that stands still: 1500 where all look like pulse widths in µs."""
    pulses = all(command.there.size and 1000.0 <= float(np.median(command.there)) <= 2000.0 for command in commands)
    return _NEUTRAL if pulses else 0.0
