"""Weight and buoyancy."""

from collections.abc import Mapping

import equinox as eqx
from jaxtyping import Array, Float

from ..effects import GRAVITY, STANDARD_DENSITY, Signal
from .inertia import CENTRE_OF_GRAVITY


class Restoring(eqx.Module):
    r"""$\tilde S(\eta)$ of a body (the first paper's eq. 1); its origin is the centre of gravity where none is given.

    **Fields**

    - `values`: `weight`, `buoyancy` N (at `reference_density`); `x_B y_B z_B`, and `x_G y_G z_G` or none of
      them, m from the origin.
    - `reference_density`: kg/m³, the water in which `buoyancy` holds.
    """

    values: dict[str, Float[Array, ""]]
    reference_density: float = eqx.field(static=True, default=STANDARD_DENSITY)

    def buoyancy(self, environment: Mapping[str, Signal]) -> Array:
        r"""$B = B_0\,\rho/\rho_{ref} + \rho g V_{ballast}$ (N) for recorded `density` kg/m³ and `ballast` m³."""
        density = environment.get("density", self.reference_density)
        displaced = self.values["buoyancy"] * density / self.reference_density
        return displaced + density * GRAVITY * environment["ballast"] if "ballast" in environment else displaced

    def force(self, down: tuple[Signal, Signal, Signal], buoyancy: Array) -> dict[str, Array]:
        """Generalised force by equation: `down` is that direction in body axes, `buoyancy` the displaced weight (N)."""
        excess = self.values["weight"] - buoyancy
        x, y, z = (self.values[name] * buoyancy for name in ("x_B", "y_B", "z_B"))
        if "x_G" in self.values:
            heavy = (self.values[name] * self.values["weight"] for name in CENTRE_OF_GRAVITY)
            x, y, z = (up - down for up, down in zip((x, y, z), heavy, strict=True))
        ahead, rolled, level = down
        return {
            "surge": excess * ahead,
            "sway": excess * rolled,
            "heave": excess * level,
            "roll": -y * level + z * rolled,
            "pitch": x * level - z * ahead,
            "yaw": -x * rolled + y * ahead,
        }
