"""The names in a vehicle file: what it is called, its states, signals and outputs, and which numbers may move."""

import dataclasses

from ..effects import VELOCITIES
from ..effects.derivatives import INPUT_UNITS
from ..parameters import Parameter
from .attitude import EULER, QUATERNION
from .sensors.output import ANGLES, SPECIFIC_FORCE, Output, channel_unit
from .ties import Tie

# what a file says of a vehicle's shape: a kind of `jaxsub init` and (dimension, SI) pairs
Geometry = tuple[str, tuple[tuple[str, float], ...]]


def deviation(name: str) -> str:
    """The state that is a run's deviation from the mean of the number `name`, which differs by run."""
    return f"{name}.deviation"


@dataclasses.dataclass(frozen=True)
class Layout:
    """The names in a vehicle file: everything about a vehicle that is not a number to estimate.

    **Fields**

    - `name`, `kind`: as in the file.
    - `equations`: the free equations of motion, in order; `positions`: the position states, in order, then those of
      effects with a memory, and the deviations of numbers that differ by run.
    - `inputs`, `prescribed`, `environment`: (name in the model, column in the recording) pairs. Inputs are held
      between samples; the other two are interpolated.
    - `outputs`: the measured channels.
    - `parameters`: what may move, how far.
    - `length`, `diameter`: of the hull, m.
    - `ties`: numbers that follow from others.
    - `input_units`: (input, SI unit) pairs of inputs other than those with a symbol, where that is known.
    - `geometry`: from which coefficients can be estimated, where the file states it.
    - `system`: in which the vehicle file gives its coefficients, in words; empty where they are in SI.
    """

    name: str
    kind: str
    equations: tuple[str, ...]
    positions: tuple[str, ...]
    inputs: tuple[tuple[str, str], ...]
    prescribed: tuple[tuple[str, str], ...]
    environment: tuple[tuple[str, str], ...]
    outputs: tuple[Output, ...]
    parameters: tuple[Parameter, ...]
    length: float = 0.0
    diameter: float = 0.0
    system: str = ""
    ties: tuple[Tie, ...] = ()
    input_units: tuple[tuple[str, str], ...] = ()
    geometry: Geometry | None = None

    @property
    def held(self) -> tuple[str, ...]:
        """Columns that are held between samples."""
        return tuple(column for _, column in self.inputs)

    @property
    def interpolated(self) -> tuple[str, ...]:
        """Columns that are interpolated between samples."""
        return tuple(column for _, column in (*self.prescribed, *self.environment))

    @property
    def channels(self) -> tuple[str, ...]:
        """The names of the outputs, by default their channels."""
        return tuple(output.name for output in self.outputs)

    @property
    def columns(self) -> tuple[str, ...]:
        """The measured column of each output."""
        return tuple(output.column for output in self.outputs)

    @property
    def measured(self) -> dict[str, str]:
        """The measured columns by output."""
        return {output.name: output.column for output in self.outputs}

    @property
    def plain(self) -> dict[str, str]:
        """By channel the measured or prescribed column that has it as it is at the origin, but for an offset."""
        known = {row.name.rpartition(".")[0] for row in self.parameters if not row.name.endswith(".offset")}
        moved = lambda o: any(o.lever_arm) and o.channel not in SPECIFIC_FORCE
        own = [o for o in self.outputs if not (o.unit or o.frame or moved(o) or {o.name, o.table} & known)]
        prescribed = {name: column for name, column in self.prescribed if name not in known}
        return prescribed | {output.channel: output.column for output in reversed(own)}

    @property
    def angles(self) -> tuple[str, ...]:
        """The columns, measured or of prescribed motions, whose whole turns are counted, as a quaternion does not."""
        prescribed = (column for name, column in self.prescribed if self.is_angle(name))
        measured = () if QUATERNION[0] in self.positions else self.outputs
        return (*(output.column for output in measured if self.is_angle(output.channel)), *prescribed)

    def tells(self, name: str) -> bool:
        """Whether the position or angle `name` is among the states, an angle also by a quaternion."""
        return name in self.positions or (name in EULER and QUATERNION[0] in self.positions)

    def is_angle(self, channel: str) -> bool:
        """Whether a whole turn leaves a channel as it is, as it does a body's Euler angles."""
        return self.kind == "submerged-body" and channel in ANGLES

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states: of the free equations (`v` of a body, `x_rate` of a mechanism, `x` else), positions."""
        named = {"submerged-body": VELOCITIES.get, "mechanism": "{}_rate".format}.get(self.kind, str)
        return (*(str(named(e)) for e in self.equations), *self.positions)

    @property
    def free(self) -> list[Parameter]:
        """The parameters that an estimator may move."""
        return [parameter for parameter in self.parameters if parameter.free]

    @property
    def deviations(self) -> dict[str, Parameter]:
        """By state the number that differs by run of which it is the deviation."""
        return {deviation(row.name): row for row in self.parameters if row.varies}

    @property
    def at_mean(self) -> "Layout":
        """That of a vehicle none of whose numbers differs by run."""
        rows = tuple(dataclasses.replace(row, varies=False, spread=0.0) for row in self.parameters)
        positions = tuple(name for name in self.positions if name not in self.deviations)
        return dataclasses.replace(self, parameters=rows, positions=positions)

    def unit(self, name: str) -> str:
        """The SI unit of `name`: an output, or a body's channel or state.

        Nothing for a mechanism's that states none: its `q` may be in metres or volts.
        """
        if name in self.deviations:
            return self.deviations[name].unit
        output = next((one for one in self.outputs if one.name == name), Output(name))
        return output.unit or (channel_unit(output.channel) if self.kind == "submerged-body" else "")

    def input_unit(self, name: str) -> str:
        """The SI unit of the input `name`; nothing where the vehicle file does not say."""
        known = INPUT_UNITS if self.kind == "submerged-body" else {}
        return known.get(name) or dict(self.input_units).get(name, "")

    def noise(self, output: Output) -> str:
        """An output with its noise in words."""
        size = "σ estimated" if output.sigma is None else f"σ {output.sigma:g} {self.unit(output.name)}".rstrip()
        return f"{output.name} ({size})"
