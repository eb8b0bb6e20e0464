"""The conditions under which two vehicles show the same outputs for any input, at random states and inputs."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..errors import InputError
from ..programs import compiled
from ..simulation.synthesis import at_rest
from ..vehicle import AbstractVehicle
from ..vehicle.base import stack

_POINTS, _INTERVAL, _INPUT, _NEWTON = 80, 0.25, 0.2, 20
# far from rest, but not so far that angles wrap; the conditions hold at every state or at none
_SCALE = {"m/s": 0.5, "rad/s": 0.3, "rad": 0.3, "m": 1.0}
_SURROUNDINGS = {"density": (1025.0, 5.0)}


class Change(eqx.Module):
    """A change of coefficients, of the reading of the state and of the equations.

    **Fields**

    - `theta`: (p,) change of the free coefficients, physical units.
    - `S`: (s, s) x = S x₁ + `shift` (s,), its diagonal blocks P and Q. `T`: (n, n) of the equations of motion.
    """

    theta: Float[Array, " p"]
    S: Float[Array, "s s"]
    shift: Float[Array, " s"]
    T: Float[Array, "n n"]


class Equivalent(eqx.Module):
    """A member of a family: `vehicle` shows from `start(x)` what the original shows from x."""

    vehicle: AbstractVehicle
    change: Change

    def start(self, original: Float[Array, "r s"]) -> Float[Array, "r s"]:
        """The initial states x₁(0) = S⁻¹ (x(0) - c) that go with `original`."""
        return jnp.linalg.solve(self.change.S, (original - self.change.shift).T).T


class Conditions(eqx.Module):
    """The conditions of equivalence at random states and inputs, in scaled unknowns (dθ, dS, c).

    **Fields**

    - `times`, `states`, `signals`: K random points, (K,), (K, s) and (K, m).
    - `column`: (u,) size of each unknown in physical units. `row`: (o,) size of each condition.
    - `free`: entries of S that are unknown. `felt`: the states that the outputs feel.
    """

    vehicle: AbstractVehicle
    times: Float[Array, " k"]
    states: Float[Array, "k s"]
    signals: Float[Array, "k m"]
    column: Float[Array, " u"]
    row: Float[Array, " o"]
    free: tuple[tuple[int, int], ...] = eqx.field(static=True)
    felt: tuple[int, ...] = eqx.field(static=True)

    @classmethod
    def of(cls, vehicle: AbstractVehicle) -> "Conditions":
        """The conditions for `vehicle`, every unknown scaled so that one of it matters as much as one of another."""
        rng, layout = np.random.default_rng(0), vehicle.layout
        names = layout.states
        scale = np.array([_SCALE.get(layout.unit(name), 1.0) for name in names])
        states = np.asarray(at_rest(vehicle, 1)) + scale * rng.standard_normal((_POINTS, len(names)))
        columns = [*layout.inputs, *layout.prescribed, *layout.environment]
        centre, width = np.array([_SURROUNDINGS.get(name, (0.0, _INPUT)) for name, _ in columns]).reshape(-1, 2).T
        signals = centre + width * rng.standard_normal((_POINTS, len(columns)))
        times = jnp.asarray(_INTERVAL * np.arange(_POINTS))
        raw = cls(vehicle, times, jnp.asarray(states), jnp.asarray(signals), jnp.ones(0), jnp.ones(0), (), ())
        felt, row = raw._felt(scale)
        n = len(layout.equations)
        free = tuple((i, j) for i in felt for j in felt if (i < n) == (j < n))
        theta = np.array([float(vehicle.values()[r.name]) for r in layout.free])
        column = [np.where(theta == 0.0, 1.0, np.abs(theta)), [scale[i] / scale[j] for i, j in free], scale[list(felt)]]
        raw = dataclasses.replace(raw, row=jnp.asarray(row), column=jnp.asarray(np.concatenate(column)))
        raw = dataclasses.replace(raw, free=free, felt=felt)
        norm = np.linalg.norm(np.asarray(raw.jacobian(jnp.zeros(raw.width))), axis=0)
        # a coefficient that nothing feels keeps its column of zeros
        norm = np.where(norm > 1e3 * np.finfo(norm.dtype).eps * norm.max(), norm, 1.0)
        return dataclasses.replace(raw, column=raw.column / norm)

    @property
    def width(self) -> int:
        """The number of unknowns."""
        return self.column.shape[0]

    def rates(self, vehicle: AbstractVehicle, states: Array) -> Float[Array, "k s"]:
        """g: accelerations and rates of the positions, the actuators having answered."""
        nodes = jnp.repeat(self.signals[:, None], 3, axis=1)
        signals = vehicle.actuate(self.times, nodes[:-1])[:, 0]
        states = states[:-1]
        motion = vehicle.motion(states, signals)
        moved = stack(vehicle.position_rates(motion), vehicle.layout.positions, states[:, 0])
        return jnp.concatenate([vehicle.acceleration(states, signals), moved], axis=-1)

    def shown(self, vehicle: AbstractVehicle, states: Array) -> Float[Array, "k c"]:
        """h: the measured channels."""
        return vehicle.measure(self.times, states, self.signals)

    def change(self, unknowns: Float[Array, " u"]) -> tuple[Array, Array, Array]:
        """dθ (p,), S (s, s) and c (s,) in physical units."""
        p, s = len(self.vehicle.layout.free), self.states.shape[1]
        physical = unknowns * self.column
        theta, entries, shift = jnp.split(physical, [p, p + len(self.free)])
        index = np.array(self.free).reshape(-1, 2).T
        S = jnp.eye(s).at[index[0], index[1]].add(entries)
        return theta, S, jnp.zeros(s).at[np.array(self.felt, int)].set(shift)

    def scaled(self, flat: Float[Array, " f"]) -> Float[Array, " u"]:
        """The unknowns of dθ, dS and c in a row, physical units."""
        p, s = len(self.vehicle.layout.free), self.states.shape[1]
        theta, S, shift = jnp.split(flat, [p, p + s * s])
        index = np.array(self.free).reshape(-1, 2).T
        entries = S.reshape(s, s)[index[0], index[1]]
        return jnp.concatenate([theta, entries, shift[np.array(self.felt, int)]]) / self.column

    def other(self, theta: Float[Array, " p"]) -> AbstractVehicle:
        """The vehicle with its free coefficients changed by `theta`."""
        values = self.vehicle.values()
        names = [row.name for row in self.vehicle.layout.free]
        return self.vehicle.with_values({n: values[n] + d for n, d in zip(names, theta, strict=True)})

    def mixing(self, theta: Array, S: Array) -> Float[Array, "n n"]:
        """T = M₁ P⁻¹ M⁻¹, of the equations that are felt."""
        mass = self.vehicle.mass_matrix()
        n = len(mass)
        T = self.other(theta).mass_matrix() @ jnp.linalg.inv(mass @ S[:n, :n])
        felt = jnp.zeros(n, bool).at[np.array([i for i in self.felt if i < n], int)].set(True)
        return jnp.where(felt[:, None] & felt, T, jnp.eye(n))

    @compiled
    def mismatch(self, unknowns: Float[Array, " u"]) -> Float[Array, " e"]:
        """By how much the changed system is not equivalent, at every point; rows of the order of one."""
        theta, S, shift = self.change(unknowns)
        other, read = self.other(theta), self.states @ S.T + shift
        rates = self.rates(other, self.states) - jnp.linalg.solve(S, self.rates(self.vehicle, read).T).T
        shown = self.shown(other, self.states) - self.shown(self.vehicle, read)
        # the last sample drives nothing
        both = jnp.concatenate([rates[:, np.array(self.felt, int)], shown[:-1]], axis=-1)
        return (both / self.row).ravel()

    @compiled
    def jacobian(self, unknowns: Float[Array, " u"]) -> Float[Array, "e u"]:
        """The Jacobian of `mismatch`."""
        return jax.jacfwd(self.mismatch)(unknowns)

    def solve(self, unknowns: Float[Array, " u"], leading: str) -> Equivalent:
        """The equivalent system nearest to `unknowns`."""
        at = np.asarray(unknowns)
        eps = np.finfo(at.dtype).eps
        for _ in range(_NEWTON):
            miss = np.asarray(self.mismatch(jnp.asarray(at)))
            # settled, or out of the numbers
            if not 1e3 * eps < np.max(np.abs(miss)) < np.inf:
                break
            at = at - np.linalg.lstsq(np.asarray(self.jacobian(jnp.asarray(at))), miss, rcond=np.sqrt(eps))[0]
        if not np.max(np.abs(miss)) < 1e5 * eps:
            raise InputError(f"family {leading}", "has no member at this distance", "take a smaller step")
        theta, S, shift = self.change(jnp.asarray(at))
        return Equivalent(self.other(theta), Change(theta, S, shift, self.mixing(theta, S)))

    def _felt(self, scale: np.ndarray) -> tuple[tuple[int, ...], np.ndarray]:
        """The states that the outputs feel, and the sizes of their rates and of the outputs."""
        by_rates, by_shown, rms = (np.asarray(a) for a in _sizes(self, jnp.asarray(scale)))
        felt = np.zeros(len(scale), bool)
        drives = lambda table: np.any(table > 1e-9 * np.max(table, axis=1, keepdims=True, initial=1e-300), axis=0)
        following = drives(by_shown)
        while (following & ~felt).any():
            felt |= following
            following = drives(by_rates[felt])
        rows = np.concatenate([rms[felt], np.linalg.norm(by_shown, axis=1)])
        return tuple(int(i) for i in np.flatnonzero(felt)), np.where(rows > 0.0, rows, 1.0)


@compiled
def _sizes(conditions: Conditions, scale: Array) -> tuple[Float[Array, "s s"], Float[Array, "c s"], Float[Array, " s"]]:
    """Root mean squares of what a state of size `scale` does to each rate and to each output, and of the rates."""
    vehicle, states = conditions.vehicle, conditions.states
    rms = lambda change: jnp.sqrt(jnp.mean(change**2, axis=0))
    push = lambda f, tangent: rms(jax.jvp(f, (states,), (jnp.broadcast_to(tangent, states.shape),))[1])
    rates = lambda states: conditions.rates(vehicle, states)
    shown = lambda states: conditions.shown(vehicle, states)
    columns = lambda f: jax.vmap(lambda tangent: push(f, tangent), out_axes=1)(jnp.diag(scale))
    return columns(rates), columns(shown), rms(rates(states))
