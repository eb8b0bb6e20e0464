"""Fins of a planform: their lift, and the water that they move."""

import dataclasses
import math

from ..geometry import lift_slope
from .file import Estimate, InitialFile, number, vector

# of planforms that are given, and of typical ones
_KNOWN, _TYPICAL = 0.3, 0.6


@dataclasses.dataclass(frozen=True)
class Fins:
    """A pair of equal fins on either side of a round hull, m, kg/m³.

    **Fields**

    - `span`: of one, from its root; `chord`: its mean; `root`: its root's distance from the axis.
    - `place`: of the pair ahead of the vehicle's middle.
    - `density`: of the water. `given`: whether the planform is the vehicle's own.
    """

    span: float
    chord: float
    root: float
    place: float
    density: float
    given: bool

    @property
    def area(self) -> float:
        """Of both, m²."""
        return 2.0 * self.span * self.chord

    @property
    def slope(self) -> Estimate:
        """Lift slope, 1/rad, of a fin that the hull doubles as a mirror does."""
        source = f"Helmbold, by the {'' if self.given else 'typical '}planform"
        return Estimate.within(_KNOWN if self.given else _TYPICAL, lift_slope(2.0 * self.span / self.chord), source)

    @property
    def induced(self) -> float:
        r"""$C_{L\alpha}/\pi\Lambda$: induced drag by the lift and its angle."""
        return self.slope.value / (math.pi * 2.0 * self.span / self.chord)

    @property
    def lift(self) -> float:
        r"""$\tfrac12\rho SC_{L\alpha}$, N/(m/s)²/rad."""
        return 0.5 * self.density * self.area * self.slope.value

    @property
    def water(self) -> float:
        r"""Added mass across the fins, kg: $\pi\rho(a - r^2/a)^2c$ by slender-body theory, a and r of tip and root.

        Of fins with the aspect ratio $\Lambda$ it is $1/\sqrt{1 + \Lambda^2}$ of that, as of rectangular plates.
        Source: Blevins (1979), tables 14-1 and 14-3; Prestero (2001), ch. 4.
        """
        tip = self.root + self.span
        return math.pi * self.density * (tip - self.root**2 / tip) ** 2 * self.chord * self._short

    @property
    def rolling(self) -> float:
        r"""Half of the added inertia in roll of a cross of two pairs, $\tfrac2\pi\rho a^4c$ (kg m²), as `water` is."""
        return self.density * (self.root + self.span) ** 4 * self.chord / math.pi * self._short

    @property
    def _short(self) -> float:
        return 1.0 / math.hypot(1.0, 2.0 * self.span / self.chord)

    @property
    def roll_damping(self) -> float:
        """Of the pair by its lift, N m/(rad/s)/(m/s)."""
        return self.lift * (self.root + self.span / 2.0) ** 2

    def actuator(self, direction: tuple[float, float, float], like: str = "") -> str:
        """The pair as an actuator, as TOML; a positive deflection pushes along `direction`.

        Its numbers are those of the actuator `like`, where that is named.
        """
        area, slope = number(self.area), self.slope.toml(free=True)
        if like:
            area, slope = f'"{like}.area"', f'"{like}.lift_slope"'
        line = f"position = {vector(self.place, 0.0, 0.0)}, direction = {vector(*direction)}"
        return f'{{ kind = "fin", {line}, area = {area}, lift_slope = {slope} }}'

    def fix(self, file: InitialFile, vertical: bool) -> None:
        """Add the derivatives of the pair without a deflection, `vertical` as a rudder is."""
        part = self.slope.std / self.slope.value
        slope, arm, square = (self.lift * self.place**power for power in range(3))
        source = "lift of the fixed fins"
        names = ("Y_uv", "Y_ur", "N_uv", "N_ur") if vertical else ("Z_uw", "Z_uq", "M_uw", "M_uq")
        sign = 1.0 if vertical else -1.0
        for name, value in zip(names, (slope, sign * arm, sign * arm, square), strict=True):
            file.add(Estimate.within(part, -value, source), name)
