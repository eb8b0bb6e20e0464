"""What each coefficient multiplies, and which actuators move it: the ground for advice on the next recording."""

import dataclasses
import itertools

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..estimate import Solution
from ..programs import compiled
from ..vehicle import AbstractVehicle

# an entry below this part of its row's largest is rounding, and a fin with less of the moment is no way to excite it
_ZERO, _SHARE = 1e-9, 0.3


@dataclasses.dataclass(frozen=True)
class Excitation:
    """What a fit's recordings moved.

    **Fields**

    - `regressors`: for each coefficient the signals it multiplies: states (`p`), their rates (`p_dot`), inputs.
    - `rms`: of each state and input about its mean, SI.
    - `movers`: for each velocity the inputs that drive it, in words; absent where none does.
    - `inputs`: the names of all that enters from outside.
    """

    regressors: dict[str, tuple[str, ...]]
    rms: dict[str, float]
    movers: dict[str, str]
    inputs: tuple[str, ...]

    @classmethod
    def of(cls, fit: Solution) -> "Excitation":
        """The excitation of a fit's recordings."""
        vehicle, layout = fit.vehicle, fit.vehicle.layout
        states = list(layout.states)
        n = len(layout.equations)
        inputs = [name for name, _ in (*layout.inputs, *layout.prescribed, *layout.environment)]
        mean, spread = _moments(fit)
        scale = np.where(spread > 0.0, spread, 1e-3)
        by_signal, inertial, driven = (
            np.asarray(a) for a in _dependence(vehicle, jnp.asarray(mean), jnp.asarray(scale))
        )
        signals = states + inputs
        regressors = {}
        for i, name in enumerate(fit.names):
            table = np.concatenate([by_signal[i], inertial[i]])
            felt = np.flatnonzero(table > _ZERO * max(table.max(), 1e-300))
            known = [*signals, *(f"{state}_dot" for state in states[:n])]
            regressors[name] = tuple(known[j] for j in felt)
        movers = {states[i]: _in_words(driven[i], inputs) for i in range(n) if np.any(driven[i])}
        return cls(regressors, dict(zip(signals, spread.tolist(), strict=True)), movers, tuple(inputs))

    def how(self, name: str) -> str:
        """What would move the regressor of the coefficient `name` more, in words."""
        signals = self.regressors[name]
        bases = list(dict.fromkeys(signal.removesuffix("_dot") for signal in signals))
        driven = [base for base in bases if base in self.movers]
        if driven:
            return f"excite {driven[0]}: move {self.movers[driven[0]]}"
        inputs = [base for base in bases if base in self.inputs]
        if inputs:
            return f"move {' and '.join(inputs)} more"
        return f"vary {' and '.join(bases)}, which no recorded input drives" if bases else "record for longer"


def _moments(fit: Solution) -> tuple[Float[np.ndarray, " z"], Float[np.ndarray, " z"]]:
    """Mean and standard deviation of each state and signal, over all samples."""
    count, mean, squares = 0, np.zeros(()), np.zeros(())
    model = fit.model
    for number, index in itertools.product(range(len(model.shares)), range(model.blocks)):
        runs, along = model.block(number, index)
        at = np.concatenate([np.asarray(along.states), np.asarray(runs.signals)], axis=-1)
        # a block's last sample is the next one's first, and what is padded does not count
        at = at[:, :-1][np.asarray(runs.live)]
        # joined with those before as by Chan, Golub and LeVeque (1983), Am. Statist. 37
        away = at.mean(axis=0) - mean
        squares = squares + at.var(axis=0) * len(at) + away**2 * (count * len(at) / (count + len(at)))
        mean = mean + away * (len(at) / (count + len(at)))
        count += len(at)
    return mean, np.sqrt(squares / count)


def _in_words(effect: np.ndarray, inputs: list[str]) -> str:
    """Which inputs to move, and which against each other."""
    strong = np.abs(effect) > _SHARE * np.abs(effect).max()
    along = [name for name, e, s in zip(inputs, effect, strong, strict=True) if s and e * effect[strong][0] > 0.0]
    against = [name for name, e, s in zip(inputs, effect, strong, strict=True) if s and e * effect[strong][0] < 0.0]
    return " and ".join(along) + (f" against {' and '.join(against)}" if against else "")


@compiled
def _dependence(
    vehicle: AbstractVehicle, at: Float[Array, " z"], scale: Float[Array, " z"]
) -> tuple[Float[Array, "p z"], Float[Array, "p n"], Float[Array, "n m"]]:
    """How each coefficient's force changes with each signal, its inertia with each rate, and rates with each input."""
    names = [row.name for row in vehicle.layout.free]
    values = vehicle.values()
    theta = jnp.stack([values[name] for name in names])
    n, m = len(vehicle.layout.equations), sum(len(pairs) for pairs in _columns(vehicle))
    with_theta = lambda theta: vehicle.with_values(dict(zip(names, theta, strict=True)))

    def force(theta: Array, signals: Array) -> Array:
        other, (state, inputs) = with_theta(theta), jnp.split(signals, [len(at) - m])
        return other.force(other.motion(state, inputs)) + other.damping_matrix() @ state[:n]

    by_theta = lambda signals: jax.jacfwd(force)(theta, signals)
    # moved in both directions: a term such as |u|u has no slope at rest
    steps = jnp.concatenate([jnp.diag(scale), -jnp.diag(scale)])
    change = jnp.abs(jax.vmap(lambda step: by_theta(at + step) - by_theta(at))(steps)).sum(1)
    inertia = jnp.abs(jax.jacfwd(lambda theta: with_theta(theta).mass_matrix())(theta)).sum(0)
    inverse = jnp.linalg.inv(vehicle.mass_matrix())
    fins = inverse @ jax.jacfwd(lambda inputs: force(theta, at.at[len(at) - m :].set(inputs)))(at[len(at) - m :])
    return (change[: len(at)] + change[len(at) :]).T, inertia.T, jnp.where(jnp.abs(fins) > _ZERO, fins, 0.0)


def _columns(vehicle: AbstractVehicle) -> tuple[tuple[tuple[str, str], ...], ...]:
    """The (name, column) pairs of everything that enters from outside."""
    return vehicle.layout.inputs, vehicle.layout.prescribed, vehicle.layout.environment
