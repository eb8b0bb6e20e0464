"""The submerged body of six degrees of freedom, or any of them."""

import dataclasses
from collections.abc import Mapping
from typing import Self

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..arrays import Values
from ..effects import EQUATIONS, VELOCITIES, AbstractEffect, Motion, Signal
from ..parameters import number
from .base import AbstractVehicle, Layout, timed
from .control import Control
from .damping import Damping
from .inertia import Inertia
from .kinematics import position_rates, specific_force
from .restoring import Restoring

_POSITIONS = ("phi", "theta", "psi", "x", "y", "z")


class SubmergedBody(AbstractVehicle):
    r"""$\tilde M\dot\nu = \tilde A\nu + \tilde B\delta + \tilde S(\eta)$ (equations.md §1), effects on top.

    Locked degrees of freedom stay at rest, surge at the operating speed; a prescribed motion comes from a column of
    the recording instead. Forces of prescribed velocities act; those of prescribed accelerations are neglected.

    **Fields**

    - `inertia`, `damping`, `control`, `restoring`: the four matrices.
    - `cruise`: operating speed U_c, m/s.
    """

    inertia: Inertia
    damping: Damping
    control: Control
    restoring: Restoring
    cruise: Float[Array, ""]
    layout: Layout = eqx.field(static=True)
    effects: tuple[AbstractEffect, ...] = ()

    def mass_matrix(self) -> Float[Values, "n n"]:
        """Inertia of the free equations."""
        return self._free(self.inertia.matrix())

    def damping_matrix(self) -> Float[Values, "n n"]:
        r"""$\tilde A$ of the free equations."""
        return self._free(self._damping())

    def own_values(self) -> dict[str, Array]:
        """Body data and coefficients."""
        parts = (self.inertia.rigid, self.inertia.added, self.damping.coefficients, self.control.coefficients)
        return {name: v for part in (*parts, self.restoring.values) for name, v in part.items()} | {
            "speed": self.cruise
        }

    def with_own_values(self, values: Mapping[str, Values]) -> Self:
        """The same body with other numbers for those named."""

        def update(named: dict[str, Array]) -> dict[str, Array]:
            return {name: number(values.get(name, old)) for name, old in named.items()}

        return dataclasses.replace(
            self,
            inertia=Inertia(update(self.inertia.rigid), update(self.inertia.added)),
            damping=Damping(update(self.damping.coefficients)),
            control=Control(update(self.control.coefficients)),
            restoring=dataclasses.replace(self.restoring, values=update(self.restoring.values)),
            cruise=number(values.get("speed", self.cruise)),
        )

    def motion(self, state: Float[Array, "*k s"], signals: Float[Array, "*k m"]) -> Motion:
        """The motion by name: free, prescribed or locked."""
        names = [f"input {n}" for n, _ in self.layout.inputs] + [n for n, _ in self.layout.prescribed]
        names += [f"environment {n}" for n, _ in self.layout.environment]
        columns, time = timed(self.layout, signals, state[..., 0])
        known: dict[str, Signal] = dict(zip(names, columns, strict=True))
        pick = lambda kind: {n.removeprefix(kind): v for n, v in known.items() if n.startswith(kind)}
        known |= {name: state[..., i] for i, name in enumerate(self.layout.states)}
        zero = jnp.zeros_like(state[..., 0])
        rates = {e: known.get(VELOCITIES[e], zero) for e in EQUATIONS}
        if "u" not in known:
            rates["surge"] = zero + self.cruise
        environment = pick("environment ")
        buoyancy = self.restoring.buoyancy(environment)
        positions = {name: known.get(name, zero) for name in (*_POSITIONS, *self.layout.positions)}
        inertia, damping = self.inertia.matrix(), self._damping()
        return Motion(rates, positions, pick("input "), environment, inertia, buoyancy, self.cruise, damping, time)

    def own_force(self, motion: Motion) -> dict[str, Signal]:
        """Control, restoring, and the damping of prescribed velocities."""
        total = self.control.force(motion.actuators)
        restoring = self.restoring.force(
            motion.positions["phi"], motion.positions["theta"], jnp.asarray(motion.buoyancy)
        )
        for equation, part in restoring.items():
            total[equation] = total.get(equation, 0.0) + part
        moved = [e for e in EQUATIONS if VELOCITIES[e] in dict(self.layout.prescribed)]
        matrix = self._damping()
        for equation in self.layout.equations if moved else ():
            row = EQUATIONS.index(equation)
            total[equation] += sum(matrix[row, EQUATIONS.index(e)] * motion.rates[e] for e in moved)
        return total

    def own_position_rates(self, motion: Motion) -> dict[str, Signal]:
        """Euler rates and velocity over ground."""
        return position_rates(motion)

    def channels(self, motion: Motion, acceleration: Mapping[str, Signal]) -> dict[str, Signal]:
        """Velocities, attitude, position and what follows from them."""
        velocities = {VELOCITIES[e]: motion.rates[e] for e in EQUATIONS}
        rates = position_rates(motion)
        u, v, w = velocities["u"], velocities["v"], velocities["w"]
        found = velocities | {name: motion.positions[name] for name in _POSITIONS}
        found |= {"depth": motion.positions["z"], "depth_rate": rates["z"], "heading_rate": rates["psi"]}
        found["speed"] = jnp.sqrt(u**2 + v**2 + w**2 + 1e-12)
        for output in self.layout.outputs if acceleration else ():
            if output.channel in ("ax", "ay", "az"):
                full = {e: acceleration.get(e, jnp.zeros_like(u)) for e in EQUATIONS}
                found[output.channel] = specific_force(motion, full, output.lever_arm)[output.channel]
        return found

    def _damping(self) -> Float[Values, "6 6"]:
        return self.damping.matrix(self.inertia.rigid["mass"], self.cruise)

    def _free(self, matrix: Float[Values, "6 6"]) -> Float[Values, "n n"]:
        rows = [EQUATIONS.index(e) for e in self.layout.equations]
        return matrix[np.ix_(rows, rows)]
