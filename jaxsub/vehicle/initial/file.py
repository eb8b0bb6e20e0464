"""A vehicle file with comments, put together from estimates."""

import dataclasses
import json
import math
from typing import Self

_WIDEST = 130  # characters of a line


@dataclasses.dataclass(frozen=True)
class Estimate:
    """A number with its standard deviation, SI, and what it was estimated from."""

    value: float
    std: float
    source: str = ""

    @classmethod
    def within(cls, part: float, value: float, source: str = "") -> Self:
        """A number that is uncertain by a `part` of itself."""
        return cls(value, abs(part * value), source)

    def toml(self, free: bool = False, digits: int = 4) -> str:
        """The number to so many `digits` with its prior; `free` where it would otherwise be fixed."""
        freed = "free = true, " if free else ""
        return f"{{ value = {number(self.value, digits)}, {freed}prior_std = {number(self.std)} }}"


@dataclasses.dataclass
class InitialFile:
    """The parts of a vehicle file.

    **Fields**

    - `name`: of the vehicle. `dof`: its free equations, all six where empty.
    - `comments`: lines above all.
    - `coefficients`: by symbol.
    - `tables`: by section and key, TOML and a comment.
    - `geometry`: that it is begun from, as TOML.
    - `unused`: columns of the log that nothing took.
    """

    name: str
    dof: tuple[str, ...] = ()
    comments: list[str] = dataclasses.field(default_factory=list)
    coefficients: dict[str, Estimate] = dataclasses.field(default_factory=dict)
    tables: dict[str, dict[str, tuple[str, str]]] = dataclasses.field(default_factory=dict)
    geometry: str = ""
    unused: list[str] = dataclasses.field(default_factory=list)

    def put(self, section: str, key: str, value: str | float, comment: str = "") -> None:
        """The `key` of a `section`; `value` is a number or TOML, and `comment` stands behind it."""
        toml = value if isinstance(value, str) else number(value)
        self.tables.setdefault(section, {})[key] = toml, comment

    def add(self, estimate: Estimate, *names: str) -> None:
        """Add the `estimate` of coefficients `names`, alike, to what each has so far; the errors are independent."""
        for name in names:
            before = self.coefficients.get(name, Estimate(0.0, 0.0))
            source = "; ".join(filter(None, (before.source, estimate.source if name == names[0] else f"as {names[0]}")))
            std = math.hypot(before.std, estimate.std)
            self.coefficients[name] = Estimate(before.value + estimate.value, std, source)

    def text(self) -> str:
        """The file."""
        lines = [f"# {comment}" for comment in self.comments]
        lines += ["schema = 1", f"name = {json.dumps(self.name)}", 'kind = "submerged-body"']
        if self.geometry:
            lines.append(f"geometry = {self.geometry}")
        if self.dof:
            lines.append(f"dof = {json.dumps(self.dof)}")
        order = ("body", "model", "coefficients", "inputs", "actuators", "outputs")
        coefficients = {name: (one.toml(), one.source) for name, one in self.coefficients.items()}
        for section in order:
            lines.append(f"[{section}]")
            table = coefficients if section == "coefficients" else self.tables.get(section, {})
            lines += [line for key, entry in table.items() for line in _lines(key, *entry)]
        return "\n".join(lines) + "\n"


def number(value: float, digits: int = 4) -> str:
    """A number to so many digits, as TOML."""
    return repr(float(f"{value:.{digits}g}"))


def vector(*values: float) -> str:
    """Several numbers, as TOML."""
    return f"[{', '.join(map(number, values))}]"


def _lines(key: str, value: str, comment: str) -> list[str]:
    """A key with its comment, beside it where there is room."""
    bare = key.replace("_", "").replace(".", "").isalnum()
    line = f"{key if bare else json.dumps(key)} = {value}"
    beside = f"{line:56} # {comment}" if comment else line
    return [beside] if len(beside) <= _WIDEST or not comment else [f"# {comment}:", line]
