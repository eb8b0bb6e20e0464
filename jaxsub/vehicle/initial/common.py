"""Parts that the files of several kinds of vehicle share."""

from ...effects import GRAVITY
from .columns import SHAFT, Columns, quoted
from .file import Estimate, InitialFile, vector
from .sizes import Sizes

SUBMERGED = (
    "u", "v", "w", "p", "q", "r", "phi", "theta", "psi", "x", "y", "z", "depth", "speed", "depth_rate", "heading_rate",
    "ax", "ay", "az",
)  # fmt: skip
SURFACE = ("u", "v", "r", "psi", "x", "y", "speed", "heading_rate", "ax", "ay")


def put_body(file: InitialFile, sizes: Sizes, inertia: tuple[float, float, float], source: str, width: float) -> None:
    """`[body]` with the `inertia` (kg m²) from `source`, of a hull of that largest `width` (m)."""
    file.put("body", "mass", sizes.mass)
    file.put("body", "inertia", vector(*inertia), source)
    file.put("body", "length", sizes.length)
    file.put("body", "diameter", width)
    file.put("body", "reference_density", sizes.density)


def put_speed(file: InitialFile, sizes: Sizes) -> None:
    """The speed about which friction was estimated for a vehicle that goes ahead; one that hovers has none."""
    file.put("body", "speed", sizes.speed, "usual speed, at which friction was estimated")


def put_trim(file: InitialFile, sizes: Sizes, height: float) -> None:
    """Buoyancy of a submerged vehicle of that `height` (m) that is trimmed, and where it acts."""
    weight = Estimate.within(0.01, GRAVITY * sizes.mass)
    # to more digits than it is known: a difference to the weight would make it sink
    file.put("body", "buoyancy", weight.toml(free=True, digits=8), "as the weight: trimmed")
    above = Estimate(-0.07 * height, 0.05 * height)
    file.put("body", "centre_of_buoyancy", f"[0.0, 0.0, {above.toml(free=True)}]", "7 % of the height: a guess")


def put_thrust(file: InitialFile, columns: Columns, sizes: Sizes, drag: Estimate) -> None:
    """What drives the vehicle ahead along its axis.

    That is the log's thrust, shaft speed or other command and, where it has none, a constant thrust. The largest
    command, or the constant, is as much as the `drag` (N/(m/s)²) at the usual speed.
    """
    needed = drag.value * sizes.speed**2
    propeller = f"{SHAFT}|motor|thruster|throttle|thrust|force|t"
    if command := columns.take(propeller, ["rad/s"], stated=True):
        file.put("inputs", "shaft_speed", quoted(command, ""), "rad/s")
        file.add(Estimate.within(1.0, needed / command.largest**2, "drag at the usual speed by the largest n"), "X_nn")
        return
    command = columns.take(propeller, ["N"], stated=True) or columns.take(propeller, [])
    if columns.log is not None and command is None:
        file.add(Estimate.within(0.6, needed, "thrust that keeps the usual speed: the log has none"), "X_0")
        return
    force = command is None or command.unit == "N"
    curve = f"gain = {Estimate(1.0, 0.1).toml(free=True)}"
    if command is not None and not force:
        curve = f"forward = {Estimate.within(1.0, needed / command.largest**2).toml(free=True)}"
    place = vector(-sizes.length / 2.0, 0.0, 0.0)
    file.put("inputs", "propeller", '{ column = "thrust", unit = "N" }' if command is None else command.toml)
    table = f'{{ kind = "thruster", position = {place}, direction = [1.0, 0.0, 0.0], {curve} }}'
    said = "the command is the thrust" if force else "drag at the usual speed by the largest command"
    file.put("actuators", "propeller", table, said)


def put_outputs(file: InitialFile, columns: Columns, moved: tuple[str, ...]) -> None:
    """`[outputs]`, and what of a log nothing uses as a comment."""
    for channel, sigma in columns.outputs(moved):
        file.put("outputs", f"{channel}.sigma", sigma)
    file.unused = columns.left
    if columns.left:
        file.comments.append(f"Not used of the log: {columns.said_of_left}.")
