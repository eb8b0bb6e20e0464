"""The submerged body of six degrees of freedom, or any of them."""

import dataclasses
from collections.abc import Mapping
from typing import Self

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..arrays import Values
from ..effects import EQUATIONS, VELOCITIES, AbstractEffect, AbstractFlow, AbstractSensor, Motion, Signal
from ..effects.environment import stream
from ..effects.hull import coriolis
from ..parameters import number
from .actuation import BodyActuation
from .actuators import Actuators, stage_numbers
from .attitude import QUATERNION, down, euler_angles
from .base import AbstractVehicle, Layout, timed
from .damping import Damping
from .inertia import Inertia, sparse
from .kinematics import position_rates
from .products import Products, derivatives
from .restoring import Restoring
from .sensors.sensors import Sensors
from .variation import sample_by_sample

_POSITIONS = ("phi", "theta", "psi", "x", "y", "z")
CURRENT = ("current_north", "current_east")
CORIOLIS = ("linear", "rigid-body", "full")
ATTITUDES = ("euler", "quaternion")


class SubmergedBody(AbstractVehicle):
    r"""$\tilde M\dot\nu = \tilde A\nu + \tau(\nu, \delta) - C(\nu)\nu + \tilde S(\eta)$, effects on top.

    $\tilde A$ is linear damping, $\tau$ the sum of all other derivatives, and $C$ the inertia's, as `coriolis` says.
    Where that is linear, $\tilde A$ has the turning of the operating speed in its place (the first paper's eq. 1).
    In water that flows with $v_c$, steady and without curl, the body moves as it would in water at rest at the velocity
    $\nu_r = \nu - [v_c\,0]$: $\tilde M\dot\nu_r$ equals the same forces, and $\dot v_c = v_c\times\nu_2$ in body axes.
    Source: Fossen (2021), §6.8 and §10.3.

    The attitude is Euler angles or, without their singularity at 90° of pitch, a unit quaternion.
    Locked degrees of freedom stay at rest, surge at the operating speed; a prescribed motion comes from a column of
    the recording instead. Forces of prescribed velocities act; those of prescribed accelerations are neglected.

    **Fields**

    - `inertia`, `damping`, `products`, `restoring`: of rigid body and added mass, of linear damping, of all other
      derivatives, of weight and buoyancy.
    - `actuators`: what pushes, lifts and weighs by a command, beside the derivatives by inputs.
    - `sensors`: scales, offsets and mountings of what is measured.
    - `cruise`: operating speed U_c, m/s.
    - `spreads`: standard deviations between runs of numbers that differ by run, SI.
    - `coriolis`: `linear` about the operating speed, where added mass has its share in the linear derivatives; `full`
      for rigid body and added mass; `rigid-body` where derivatives such as `X_wq` hold what is the added mass's.
    """

    inertia: Inertia
    damping: Damping
    products: Products
    restoring: Restoring
    cruise: Float[Array, ""]
    layout: Layout = eqx.field(static=True)
    effects: tuple[AbstractEffect, ...] = ()
    coriolis: str = eqx.field(static=True, default="linear")
    actuators: Actuators = eqx.field(default_factory=Actuators)
    sensors: Sensors = eqx.field(default_factory=Sensors)
    spreads: dict[str, Array] = eqx.field(default_factory=dict)

    @property
    def attitude(self) -> str:
        """One of `ATTITUDES`."""
        return ATTITUDES[QUATERNION[0] in self.layout.positions]

    def mass_matrix(self) -> Float[Values, "n n"]:
        """Inertia of the free equations."""
        return self._free(self.inertia.matrix())

    def damping_matrix(self) -> Float[Values, "n n"]:
        r"""$\tilde A$ of the free equations."""
        return self._free(self._damping())

    def own_values(self) -> dict[str, Array]:
        """Body data and coefficients."""
        parts = (self.inertia.rigid, self.inertia.added, self.damping.coefficients, self.products.coefficients)
        parts = (*parts, self.restoring.values, self.actuators.values(), {"speed": self.cruise}, self.sensors.numbers)
        return {name: value for part in parts for name, value in part.items()}

    def with_own_values(self, values: Mapping[str, Values]) -> Self:
        """The same body with other numbers for those named."""

        def update(named: dict[str, Array]) -> dict[str, Array]:
            return {name: number(values.get(name, old)) for name, old in named.items()}

        return dataclasses.replace(
            self,
            inertia=Inertia(update(self.inertia.rigid), update(self.inertia.added)),
            damping=Damping(update(self.damping.coefficients)),
            products=Products(update(self.products.coefficients)),
            restoring=dataclasses.replace(self.restoring, values=update(self.restoring.values)),
            cruise=number(values.get("speed", self.cruise)),
            actuators=self.actuators.with_values(values),
            sensors=self.sensors.with_values(values),
        )

    def motion(self, state: Float[Array, "*k s"], signals: Float[Array, "*k m"]) -> Motion:
        """The motion by name: free, prescribed or locked."""
        names = [f"input {n}" for n, _ in self.layout.inputs] + [n for n, _ in self.layout.prescribed]
        names += [f"environment {n}" for n, _ in self.layout.environment]
        columns, time = timed(self.layout, signals, state[..., 0])
        known: dict[str, Signal] = dict(zip(names, columns, strict=True))
        known |= {name: state[..., i] for i, name in enumerate(self.layout.states)}
        pick = lambda kind: {n.removeprefix(kind): v for n, v in known.items() if n.startswith(kind)}
        environment = pick("environment ")
        shape = state.shape[:-1] if self.spreads else ()
        moved, buoyancy, cruise = sample_by_sample(self._of_run, shape, known, environment)
        known |= moved
        for effect in self.effects:
            if isinstance(effect, AbstractSensor) and effect.channel in moved and not self.shows(effect):
                known[effect.channel] = effect.undone(time, known[effect.channel])
        zero = jnp.zeros_like(state[..., 0])
        rates = {e: known.get(VELOCITIES[e], zero) for e in EQUATIONS}
        if "u" not in known:
            rates["surge"] = zero + cruise
        positions = {name: known.get(name, zero) for name in (*_POSITIONS, *self.layout.positions)}
        if QUATERNION[0] in positions:
            positions |= euler_angles(positions)
        water = self._water(positions, environment, zero)
        return Motion(
            rates, positions, pick("input "), environment, self.inertia.matrix(), buoyancy, cruise, time,
            water=water, actuation=self.actuation,
        )  # fmt: skip

    def own_force(self, motion: Motion) -> dict[str, Signal]:
        """Products, actuators, restoring, Coriolis, what a current adds, and the damping of prescribed velocities."""
        total = self.products.force(motion)
        for equation, part in self.actuators.force(motion).items():
            total[equation] = total.get(equation, 0.0) + part
        restoring = self.restoring.force(down(motion.positions), jnp.asarray(motion.buoyancy))
        for equation, part in restoring.items():
            total[equation] = total.get(equation, 0.0) + part
        moved = [e for e in EQUATIONS if VELOCITIES[e] in dict(self.layout.prescribed)]
        matrix = self._damping()
        for equation in self.layout.equations if moved else ():
            row = EQUATIONS.index(equation)
            total[equation] += sum(matrix[row, EQUATIONS.index(e)] * motion.rates[e] for e in moved)
        more = [self._turning(motion)] if self.coriolis != "linear" else []
        more += [self._drift(motion)] if motion.water else []
        for part in more:
            for i, equation in enumerate(EQUATIONS):
                total[equation] = total.get(equation, 0.0) + part[..., i]
        return total

    @property
    def has(self) -> frozenset[str]:
        """Also its derivatives, by symbol, those of its actuators, and `coriolis` where that is not linear."""
        names = (*self.inertia.added, *self.damping.coefficients, *self.products.coefficients)
        turning = () if self.coriolis == "linear" else ("coriolis",)
        own = (*(term.name for term in derivatives(names).values()), *self.actuators.names, *turning)
        return super().has.union(own)

    @property
    def density(self) -> float:
        """Its `reference_density`."""
        return self.restoring.reference_density

    @property
    def speed(self) -> float:
        """U_c."""
        return float(self.cruise)

    @property
    def fixed_gains(self) -> tuple[str, ...]:
        """The devices whose `gain` is not free, and inputs of which not every coefficient is."""
        return self.actuation.fixed_gains(self.layout)

    @property
    def actuation(self) -> BodyActuation:
        """By products of inputs, and by devices."""
        return BodyActuation(self.products, self.actuators)

    @property
    def linear(self) -> frozenset[str]:
        """Masses, linear damping, and the operating speed."""
        return frozenset((*self.inertia.rigid, *self.inertia.added, *self.damping.coefficients, "speed"))

    @property
    def aliases(self) -> dict[str, str]:
        """Numbers of what stands before its actuators, such as `bow.time_constant`."""
        return stage_numbers(self.actuators.items, self.effects)

    @property
    def nonlinear(self) -> tuple[Products | Actuators, ...]:
        """The products and the actuators, where any follows a velocity."""
        moved = any(item.follows for item in self.actuators.items)
        return (*((self.products,) if self.products.damp else ()), *((self.actuators,) if moved else ()))

    def own_position_rates(self, motion: Motion) -> dict[str, Signal]:
        """Euler rates and velocity over ground."""
        return position_rates(motion)

    def channels(self, motion: Motion) -> dict[str, Signal]:
        """Velocities, attitude, position and what follows from them."""
        velocities = {VELOCITIES[e]: motion.rates[e] for e in EQUATIONS}
        rates = position_rates(motion)
        u, v, w = velocities["u"], velocities["v"], velocities["w"]
        found = velocities | {name: motion.positions[name] for name in _POSITIONS}
        found |= {"depth": motion.positions["z"], "depth_rate": rates["z"], "heading_rate": rates["psi"]}
        return found | {"speed": jnp.sqrt(u**2 + v**2 + w**2 + 1e-12)}

    def _of_run(
        self, known: Mapping[str, Signal], environment: Mapping[str, Signal]
    ) -> tuple[dict[str, Signal], Signal, Signal]:
        """Prescribed motions as they were, the displaced weight (N) and the operating speed (m/s) of a run."""
        run = self.of_run(known)
        prescribed = {name: run.sensors.true(name, known[name]) for name, _ in self.layout.prescribed}
        return prescribed, run.restoring.buoyancy(environment), run.cruise

    def _damping(self) -> Float[Values, "6 6"]:
        if self.coriolis != "linear":
            return sparse(self.damping.own())
        return self.damping.matrix(self.inertia.rigid, self.cruise)

    def _turning(self, motion: Motion) -> Values:
        r"""$-C(\nu_r)\nu_r$ (N, N m), (…, 6)."""
        inertia = self.inertia.matrix() if self.coriolis == "full" else self.inertia.body_matrix()
        flow = jnp.stack(jnp.broadcast_arrays(*(motion.flow[e] for e in EQUATIONS)), -1)
        return coriolis(jnp.asarray(inertia), flow)

    def _drift(self, motion: Motion) -> Values:
        """What moving water changes beside the products (N, N m), (…, 6): damping, and the inertia of its turning."""
        stacked = lambda named, keys: jnp.stack(jnp.broadcast_arrays(*(named[k] for k in keys)), -1)
        moving, turning = stacked(motion.water, EQUATIONS[:3]), stacked(motion.rates, EQUATIONS[3:])
        turned = jnp.cross(moving, turning)
        return turned @ self.inertia.matrix()[:, :3].T - moving @ self._damping()[:, :3].T

    def _water(
        self, positions: Mapping[str, Signal], environment: Mapping[str, Signal], still: Signal
    ) -> dict[str, Signal]:
        """Velocity of the water in body axes (m/s), recorded and by effects; nothing where there is neither."""
        recorded = [environment.get(name) for name in CURRENT]
        flows = [effect.water(positions) for effect in self.effects if isinstance(effect, AbstractFlow)]
        if any(part is not None for part in recorded):
            north, east = (still if part is None else part for part in recorded)
            flows.append(stream(positions, north, east))
        return {e: sum(parts, still) for e, *parts in zip(EQUATIONS, *flows, strict=False)} if flows else {}

    def _free(self, matrix: Float[Values, "6 6"]) -> Float[Values, "n n"]:
        rows = [EQUATIONS.index(e) for e in self.layout.equations]
        return matrix[np.ix_(rows, rows)]
