"""Hydrodynamic derivatives: the field's grammar for a force that is proportional to a product of motions and inputs."""

import dataclasses
import functools
import re
from collections.abc import Collection, Iterable, Sequence

from ..arrays import namespace
from .motion import EQUATIONS, FORCES, VELOCITIES, Motion, Signal, unit_per

INPUT_SYMBOLS = {
    "rudder": "delta_r",
    "elevator_right": "delta_er",
    "elevator_left": "delta_el",
    "elevator": "delta_e",
    "stern_plane": "delta_s",
    "thrust": "T",
    "shaft_speed": "n",
}
INPUT_UNITS: dict[str, str] = dict.fromkeys(INPUT_SYMBOLS, "rad") | {"thrust": "N", "shaft_speed": "rad/s"}
_SPEED = "speed"
# as `Y_v|v|`, `N_u_delta_r`: factors follow each other, or stand apart by an underscore
_SYMBOLS = {v: e for e, v in VELOCITIES.items()} | {symbol: name for name, symbol in INPUT_SYMBOLS.items()}
_SYMBOLS["U"] = _SPEED
_FACTOR = "|".join(sorted(_SYMBOLS, key=len, reverse=True))
_TOKEN = re.compile(rf"_?(?:\|({_FACTOR})\||({_FACTOR}))")
_RATE = re.compile(r"[uvwpqr]dot")
# as `B_yaw_bow_thruster`, of an input that has no symbol
_BY_NAME = re.compile(rf"B_({'|'.join(EQUATIONS)})_([A-Za-z_]\w*)")
_HIGHEST = 6  # of the sum of powers: Taylor series of the field end at the third or fifth
# of velocities and inputs: exponents of mass, length and time
_FORCE = (1, 1, -2)
_DIMENSIONS: dict[str, tuple[int, int, int]] = {
    **dict.fromkeys((*EQUATIONS[:3], _SPEED), (0, 1, -1)),
    **dict.fromkeys((*EQUATIONS[3:], "shaft_speed"), (0, 0, -1)),
    "thrust": _FORCE,
}


@dataclasses.dataclass(frozen=True)
class Power:
    r"""One variable of a product: $x^k$, or $|x|^k$ or $|x|^{k-1}x$, whichever has the parity that `odd` says.

    **Fields**

    - `variable`: an equation of motion (its velocity), an actuator, or `speed`. `power`: k, below zero of speed alone.
    - `odd`: whether the factor changes its sign with the variable's.
    """

    variable: str
    power: int = 1
    odd: bool = True

    @property
    def smooth(self) -> bool:
        """Whether it needs no absolute value."""
        return self.odd == bool(self.power % 2)

    def of(self, value: Signal) -> Signal:
        """The factor for the variable's `value`, of any shape."""
        if self.power == 1:
            return value if self.odd else abs(value)
        if self.smooth:
            return value**self.power
        return abs(value) ** (self.power - 1) * value if self.odd else abs(value) ** self.power


@dataclasses.dataclass(frozen=True)
class Derivative:
    r"""A force that is proportional to a product: $\tau_i = c\,x_1^{k_1} x_2^{k_2} \cdots$, or to an acceleration.

    A coefficient of a vehicle file is one by its name (`derivative`), and so is an effect whose only number is such a
    coefficient; both get the product, its unit and its dimension from here. Velocities are those through the water,
    and so is the speed $U = \sqrt{u^2 + v^2 + w^2}$, by which a product may also be divided.

    **Fields**

    - `equation`: where the force acts. `powers`: the factors; none for a constant force.
    - `rate`: of an added mass; the one factor is then the acceleration and not the velocity.
    """

    equation: str
    powers: tuple[Power, ...] = ()
    rate: bool = False

    @classmethod
    def by(cls, equation: str, *variables: str) -> "Derivative":
        """The derivative of an `equation` by a product of `variables`; of two equal ones only as their square."""
        return cls(equation, _gathered([(variable, False) for variable in variables]))

    @property
    def variables(self) -> tuple[str, ...]:
        """Equations, actuators and speed in the product, each as often as its power."""
        return tuple(power.variable for power in self.powers for _ in range(power.power))

    @property
    def inputs(self) -> tuple[str, ...]:
        """The actuators in the product, each as often as its power."""
        return tuple(variable for variable in self.variables if variable not in (*EQUATIONS, _SPEED))

    @property
    def moved(self) -> tuple[str, ...]:
        """The equations whose velocities are in the product; surge where the speed is."""
        own = (EQUATIONS[0] if power.variable == _SPEED else power.variable for power in self.powers)
        return tuple(dict.fromkeys(variable for variable in own if variable in EQUATIONS))

    @property
    def linear(self) -> bool:
        """Whether it is linear damping: proportional to one velocity."""
        single = not self.rate and len(self.powers) == 1 and self.powers[0].power == 1 and self.powers[0].odd
        return single and self.powers[0].variable in EQUATIONS

    @property
    def sign(self) -> int:
        """-1 of `K_delta_el`, which the field writes with a minus: port and starboard fins roll a hull the same way."""
        return -1 if (self.equation, self.variables) == ("roll", ("elevator_left",)) else 1

    @property
    def name(self) -> str:
        """Its symbol in a vehicle file, such as `K_p|p|`; by an input without a symbol alone, `B_yaw_bow_thruster`."""
        if not self.dimensional and self.powers == (Power(self.variables[0]),):
            return f"B_{self.equation}_{self.variables[0]}"
        written = "_".join(_joined([power for power in self.powers if power.power > 0])) or "0"
        below = "".join(f"/{'U' * -power.power}" for power in self.powers if power.power < 0)
        return f"{FORCES[self.equation]}_{written}{'dot' if self.rate else ''}{below}"

    @property
    def dimensional(self) -> bool:
        """Whether the dimension of every factor is known, as that of an input without a symbol is not."""
        return all(variable in INPUT_SYMBOLS for variable in self.inputs)

    @property
    def unit(self) -> str:
        """The SI unit, such as `N/(m/s)` of `Y_v` and `kg*m` of `Y_rdot`; empty where it is not known."""
        if self.equation in EQUATIONS and not self.dimensional:
            return ""
        if self.rate:
            return ("kg", "kg*m", "kg*m^2")[sum(e in EQUATIONS[3:] for e in (self.equation, *self.variables))]
        below = sum(-power.power for power in self.powers if power.power < 0)
        return unit_per(self.equation, *self.variables) + below * "*(m/s)"

    @property
    def dimension(self) -> tuple[int, int, int]:
        """The exponents of mass, length and time, where the derivative is `dimensional`."""
        lever = (0, 1, 0) if self.equation in EQUATIONS[3:] else (0, 0, 0)
        total = [a + b for a, b in zip(_FORCE, lever, strict=True)]
        for power in self.powers:
            own = _DIMENSIONS.get(power.variable, (0, 0, 0))
            total = [a - power.power * b for a, b in zip(total, own, strict=True)]
        mass, length, time = total
        return mass, length, time + self.rate

    @property
    def expression(self) -> str:
        """The product, as a person would write it: `|p| p`, `v r`, `rudder T`."""
        own = VELOCITIES | {"thrust": "T", "shaft_speed": "n", _SPEED: "U"}
        if self.equation not in EQUATIONS:
            own[self.equation] = f"{self.equation}'"
        return " ".join(_raised(own.get(power.variable, power.variable), power) for power in self.powers)

    def needs(self) -> tuple[tuple[str, ...], ...]:
        """The sets of actuators, any one of which the product can be taken from; empty where it has none."""
        own = tuple(dict.fromkeys(self.inputs))
        if "elevator" in own:
            rest = tuple(name for name in own if name != "elevator")
            return (own, (*rest, "elevator_right", "elevator_left"))
        return (own,) if own else ()

    def through(self, inputs: Collection[str]) -> tuple[str, ...]:
        """The actuators that the product is taken from where there are `inputs`; none where it needs others."""
        return next((way for way in self.needs() if set(way) <= set(inputs)), ())

    def product(self, motion: Motion) -> Signal | float:
        """The product along a motion, of its shape; 1 for a constant.

        `elevator` is the mean of its halves where there are two. **Raises** `KeyError` for what the motion lacks.
        """
        parts = [power.of(_value(power.variable, motion)) for power in self.powers]
        return functools.reduce(lambda a, b: a * b, parts) if parts else 1.0


def _value(variable: str, motion: Motion) -> Signal:
    if variable in motion.rates:
        return motion.flow[variable]
    if variable == _SPEED:
        u, v, w = (motion.flow[e] for e in EQUATIONS[:3])
        # which has a slope at rest too
        return namespace(u, v, w).sqrt(u**2 + v**2 + w**2 + 1e-12)
    if variable == "elevator" and variable not in motion.actuators:
        return 0.5 * (motion.actuators["elevator_right"] + motion.actuators["elevator_left"])
    return motion.actuators[variable]


@functools.cache
def derivative(name: str) -> Derivative | None:
    """The derivative of the symbol `name`, such as `N_vvr` or `Z_w|w|`; None for what is no such symbol.

    `X_nn` is $X_{nn}|n|n$, as the field has it. U is the speed, and `"Y_vvv/U"` a product divided by it.
    `B_yaw_bow_thruster` is the moment by any input of that name.
    """
    if by_name := _BY_NAME.fullmatch(name):
        return Derivative(by_name[1], (Power(by_name[2]),))
    equation = {letter: e for e, letter in FORCES.items()}.get(name[:1])
    symbol, slash, below = name[2:].partition("/")
    if slash and not re.fullmatch(r"U+", below):
        return None
    if equation is None or name[1:2] != "_" or len(name) > 60:
        return None
    if symbol == "0" and not slash:
        return Derivative(equation)
    if not slash and _RATE.fullmatch(symbol):
        return Derivative(equation, (Power(_SYMBOLS[symbol[0]]),), rate=True)
    factors, at = [], 0
    while at < len(symbol):
        if not (token := _TOKEN.match(symbol, at)) or (not at and symbol[0] == "_"):
            return None
        factors.append((_SYMBOLS[token[1] or token[2]], bool(token[1])))
        at = token.end()
    if not factors or len(factors) + len(below) > _HIGHEST:
        return None
    if [factor for factor in factors if factor[0] == "shaft_speed"] == [("shaft_speed", False)] * 2:
        # a propeller that turns backwards pushes backwards
        factors[factors.index(("shaft_speed", False))] = ("shaft_speed", True)
    return Derivative(equation, _gathered(factors, len(below)))


def alike(names: Iterable[str]) -> tuple[str, str] | None:
    """The first two of `names` that say the same derivative, if any do."""
    seen: dict[Derivative, str] = {}
    for name in names:
        if (found := derivative(name)) is not None and (other := seen.setdefault(found, name)) != name:
            return other, name
    return None


def _gathered(factors: Sequence[tuple[str, bool]], below: int = 0) -> tuple[Power, ...]:
    """Factors, each a variable and whether it is absolute, over that power of speed, in the order of the field."""
    order = [_SPEED, *EQUATIONS, *INPUT_SYMBOLS]
    named = {name for name, _ in factors} | ({_SPEED} if below else set())
    variables = sorted(named, key=lambda n: (order.index(n) if n in order else len(order), n))
    powers = []
    for variable in variables:
        if variable == _SPEED:
            if count := sum(name == _SPEED for name, _ in factors) - below:
                powers.append(Power(_SPEED, count, bool(count % 2)))
            continue
        own = [absolute for name, absolute in factors if name == variable]
        powers.append(Power(variable, len(own), (len(own) - sum(own)) % 2 == 1))
    return tuple(powers)


def _joined(powers: Sequence[Power]) -> list[str]:
    """The symbols of powers in groups that an underscore has to keep apart: `uu` and `delta_r`."""
    groups: list[str] = []
    for power in powers:
        symbol = "U" if power.variable == _SPEED else VELOCITIES.get(power.variable, "")
        symbol = symbol or INPUT_SYMBOLS.get(power.variable, power.variable)
        text = _symbols(power, symbol)
        if groups and power.variable in EQUATIONS:
            groups[-1] += text
        else:
            groups.append(text)
    return groups


def _symbols(power: Power, symbol: str) -> str:
    if power.variable == "shaft_speed" and power.power == 2:
        return symbol * 2 if power.odd else f"|{symbol}|" * 2
    separator = "_" if len(symbol) > 1 else ""
    if power.smooth:
        return separator.join([symbol] * power.power)
    return separator.join([symbol] * (power.power - 1) + [f"|{symbol}|"])


def _raised(name: str, power: Power) -> str:
    raised = lambda k: {1: "", 2: "²", 3: "³"}.get(k, f"^{k}")
    if power.smooth:
        return f"{name}{raised(power.power)}"
    if power.odd:
        return f"|{name}|{raised(power.power - 1)} {name}"
    return f"|{name}|{raised(power.power)}"
