"""How far and how fast a control surface moves."""

import math

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..errors import InputError
from ..parameters import number

# 20° is where Fossen's MSS stops the fins of both catalogue vehicles (npsauv.m, remus100.m). Neither publication gives
# a rate; 30°/s is that of a small electric fin servo.
AMPLITUDE, RATE = math.radians(20.0), math.radians(30.0)


class FinLimits(eqx.Module):
    r"""Amplitude and rate limits of a control surface.

    $\delta_k = \mathrm{clip}(\mathrm{clip}(\delta_{cmd}, \delta_{k-1} \pm \dot\delta_{max}\Delta), \pm\delta_{max})$.
    Source: Fossen (2021), §9.5.

    **Fields**

    - `amplitude`: rad, infinite for none. `rate`: rad/s, infinite for none. Those of several fins may be one array.
    """

    amplitude: Float[Array, " *m"]
    rate: Float[Array, " *m"]

    @classmethod
    def of(cls, amplitude: float = AMPLITUDE, rate: float = RATE) -> "FinLimits":
        """Limits `amplitude` in rad and `rate` in rad/s. **Raises** `InputError` where one is not positive."""
        for name, value in (("amplitude", amplitude), ("rate", rate)):
            if not value > 0.0:
                raise InputError(f"fin limits: {name}", f"{value:g} is not positive", "inf stands for no limit")
        return cls(number(float(amplitude)), number(float(rate)))

    def apply(
        self, command: Float[Array, " *m"], previous: Float[Array, " *m"], dt: Float[Array, ""] | float
    ) -> Float[Array, " *m"]:
        """The deflection (rad) that a `command` becomes `dt` s after the deflection `previous`."""
        reach = self.rate * dt
        return jnp.clip(jnp.clip(command, previous - reach, previous + reach), -self.amplitude, self.amplitude)
