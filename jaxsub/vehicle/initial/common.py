"""Parts that the files of several kinds of vehicle have alike."""

from ...effects import GRAVITY
from .columns import Columns
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
    file.put("body", "speed", sizes.speed, "usual speed, at which friction was estimated")
    file.put("body", "length", sizes.length)
    file.put("body", "diameter", width)
    file.put("body", "reference_density", sizes.density)


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
    if columns.log is None or (command := columns.take("thrust|force|t", ["N"])):
        file.put("inputs", "thrust", f'"{command.column if columns.log else "thrust"}"', "N, along x")
    elif command := columns.take("n|rpm|rps|shaft|prop|propeller|motor|thruster", ["rad/s"], stated=True):
        file.put("inputs", "shaft_speed", f'"{command.column}"')
        file.add(Estimate.within(1.0, needed / command.largest**2, "drag at the usual speed by the largest n"), "X_nn")
    elif command := columns.take("n|rpm|rps|shaft|prop|propeller|motor|thruster|throttle|pwm|thrust", []):
        file.put("inputs", "propeller", command.toml)
        forward = Estimate.within(1.0, needed / command.largest**2).toml(free=True)
        place = vector(-sizes.length / 2.0, 0.0, 0.0)
        table = f'{{ kind = "thruster", position = {place}, direction = [1, 0, 0], forward = {forward} }}'
        file.put("actuators", "propeller", table, "drag at the usual speed by the largest command")
    else:
        file.add(Estimate.within(0.6, needed, "thrust that keeps the usual speed: the log has none"), "X_0")


def put_outputs(file: InitialFile, columns: Columns, moved: tuple[str, ...]) -> None:
    """`[outputs]`, and what of a log nothing uses as a comment."""
    for channel, sigma in columns.outputs(moved):
        file.put("outputs", f"{channel}.sigma", sigma)
    file.unused = columns.left
    if columns.left:
        file.comments.append(f"Not used of the log: {', '.join(columns.left)}.")
