"""What a recording may conceal: a piece of physics in the generator's own words, which share nothing with the judge's.

A truth changes the vehicle in one of four ways: a generalised force, the deflection that a command becomes, what a
sensor shows of the motion, or states of its own beside the vehicle's. `a` is its size, the one number that is scaled.
"""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from jax import Array

from jaxsub.arrays import Values
from jaxsub.effects import Motion

WATER = 1025.0
GRAVITY = 9.80665


class Moment(NamedTuple):
    """One instant: time (s) since the run's start, the motion by name, the truth's own states, linear damping."""

    t: Array
    motion: Motion
    memory: Array
    damping: Values

    @property
    def rates(self) -> Mapping[str, Any]:
        """Velocities by equation, m/s or rad/s."""
        return self.motion.rates

    @property
    def positions(self) -> Mapping[str, Any]:
        """Attitude and position by name, or a mechanism's coordinates."""
        return self.motion.positions

    @property
    def actuators(self) -> Mapping[str, Any]:
        """Deflections and speeds by actuator."""
        return self.motion.actuators


Force = Callable[[Any, Moment], Mapping[Any, Any]]
Command = Callable[[Any, float, Any], Any]
Sense = Callable[[Any, Any, dict[str, Any]], dict[str, Any]]


@dataclasses.dataclass(frozen=True)
class Truth:
    """One concealed effect.

    **Fields**

    - `name`: as in the vocabulary, or `outside …` for what that lacks; `form`: which equation, actuator or
      sensor; `family` as in the vocabulary.
    - `where`: the places that count as its location; `lenient`: those that count when one is lenient.
    - `limit`: the size beyond which it would be another kind of thing (a fin's travel, a capsize).
    - `vehicle`: which body it is concealed in.
    - `force(a, moment)`: newtons by equation. `command(a, h, held)`: deflections at steps of h s, (F,), of `actuator`.
      `sense(a, times, channels)`: channels that sensors show otherwise, each (K,).
    - `memory`: number of own states, from zero; `memory_rates(a, moment)` their rates.
    - `numbers(a)`: those of its parameters that the vocabulary has too, by symbol.
    """

    name: str
    form: str
    family: str
    where: tuple[str, ...]
    limit: float
    vehicle: str = "nps"
    force: Force | None = None
    actuator: str | None = None
    command: Command | None = None
    sense: Sense | None = None
    memory: int = 0
    memory_rates: Callable[[Any, Moment], Any] | None = None
    numbers: Callable[[float], dict[str, float]] = lambda a: {}
    lenient: tuple[str, ...] = ()

    @property
    def key(self) -> str:
        """Name and form."""
        return f"{self.name}[{self.form}]"

    @property
    def outside(self) -> bool:
        """Whether the vocabulary lacks it."""
        return self.family == "outside"

    @property
    def is_column(self) -> bool:
        """Whether it is a force without states, which a regression on residual force can have as a term."""
        return self.force is not None and not self.memory
