r"""How far apart rival explanations of a mismatch are on a run that is yet to be made, and how that grows.

With truth a and rival b, $y_a$ and $y_b$ what their sensors would show in units of the noise, $S_b$ the sensitivities
of $y_b$ to its free coefficients and to its initial state, and $\Lambda_b$ what is known of these beforehand, the rival
that is refitted to what a recorded misses it by

$\chi^2_{ab} = \min_\beta\,|y_a - y_b - S_b\beta|^2 + \beta^T\Lambda_b\beta$,

the expected gain of the log-likelihood ratio, times two, by the run. Its gradient by the inputs is, as $\beta$ is at a
minimum, that of the same with $\beta$ held: reverse mode through plain simulations and not through sensitivities.
Sources: Box and Hill (1967), Technometrics 9(1); Atkinson and Fedorov (1975), Biometrika 62(1).
"""

import dataclasses
from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.scipy.linalg import cho_factor, cho_solve
from jaxtyping import Array, Float

from ..estimate import Problem
from ..recording.runs import Runs
from ..simulation import Sampled
from ..vehicle import AbstractVehicle
from .design_limits import Bounds

# weight of the squared excess over a channel's limit, and the part of the limit from which it counts
_PENALTY, _MARGIN = 30.0, 0.98
# how nearly the mean over pairs is the smallest of them; a separation below which there is none
_SHARP, _NONE = 4.0, 1e-6
# information on a direction of the coefficients that nothing identifies, relative to a column of unit length
_UNTOLD = 1e-10


class Rivals(eqx.Module):
    """R rivals on one run of K samples whose held inputs are to be found.

    **Fields**

    - `vehicles`: R, each with its effect; `starts`, `spreads`: (1, s) and (s,) of their initial states.
    - `priors`: (p,) standard deviation of the free numbers of each.
    - `weight`: (c,) root of the share of samples at which a channel is measured, over its noise, SI.
    - `runs`: the run. `bounds`: of the inputs and channels. `anchor`: (K, m) inputs that are known to be safe.
    """

    vehicles: tuple[AbstractVehicle, ...]
    starts: tuple[Float[Array, "1 _"], ...]
    spreads: tuple[Float[Array, " _"], ...]
    priors: tuple[Float[Array, " _"], ...]
    weight: Float[Array, " c"]
    runs: Runs
    bounds: Bounds
    anchor: Float[Array, "k m"]

    @classmethod
    def of(
        cls, models: Sequence[AbstractVehicle], recorded: Runs, run: Runs, sigma: Array, bounds: Bounds, anchor: Array
    ) -> "Rivals":
        """The rivals `models` on `run`, from the initial states of `recorded`."""
        problems = [Problem.of(model, recorded, sigma) for model in models]
        return cls(
            tuple(models),
            tuple(problem.guess for problem in problems),
            tuple(problem.start_std for problem in problems),
            tuple(problem.prior_std for problem in problems),
            jnp.sqrt(jnp.mean(recorded.mask, axis=(0, 1))) / sigma,
            run,
            bounds,
            anchor,
        )

    def driven(self, inputs: Float[Array, "k m"]) -> Runs:
        """The run with these held inputs."""
        rest = self.runs.signals[0, :, inputs.shape[1] :]
        return dataclasses.replace(self.runs, signals=jnp.concatenate([inputs, rest], axis=1)[None])

    def excess(self, inputs: Float[Array, "k m"]) -> Float[Array, "k c1"]:
        """How much of their limits the channels take, the rival that takes most; not-a-number is infinite."""
        runs = self.driven(inputs)
        return self._most([self._answer(i, runs, *self._at(i))[0] for i in range(len(self.vehicles))], runs)

    def separations(self, inputs: Float[Array, "k m"]) -> Float[Array, "r r"]:
        """Expected χ² of each refitted rival (column) where another (row) is the truth; infinite on the diagonal."""
        return self._refitted(self.driven(inputs))[0]

    def worth(self, inputs: Float[Array, "k m"]) -> tuple[Float[Array, "r r"], Float[Array, "k c1"]]:
        """`separations` and `excess`, with the separations' gradient by the inputs at the cost of plain simulations."""
        runs = self.driven(inputs)
        apart, betas, misfits = jax.lax.stop_gradient(self._refitted(jax.lax.stop_gradient(runs)))
        states, answers, tangents = [], [], []
        for rival, beta in enumerate(betas):
            # differences along β: a tangent would have to be transposed as well, which takes a minute to compile
            step = jnp.finfo(beta.dtype).eps ** (1 / 3) / (jnp.max(jnp.abs(beta), axis=1, keepdims=True) + 1.0)
            points = jnp.concatenate([jnp.zeros_like(beta[:1]), step * beta, -step * beta])
            path, shown = jax.vmap(lambda y, i=rival: self._answer(i, runs, *self._at(i, y)))(points)
            ahead, behind = jnp.split(shown[1:], 2)
            states.append(path[0])
            answers.append(shown[0])
            tangents.append((ahead - behind) / (2.0 * step[..., None]))
        # β is at a minimum: it does not move to first order, and the misfit weighs what does
        missed = [jnp.stack(answers) - answers[rival] - tangents[rival] for rival in range(len(betas))]
        pairs = zip(misfits, missed, strict=True)
        slope = jnp.stack([2.0 * jnp.sum(by * self.weight * miss, axis=(1, 2)) for by, miss in pairs], axis=1)
        return apart + slope - jax.lax.stop_gradient(slope), self._most(states, runs)

    def _at(self, rival: int, moved: Array | None = None) -> tuple[Array, Array]:
        """The free numbers and initial state of a rival, `moved` (p + s,) from its own in its units."""
        vehicle, values = self.vehicles[rival], self.vehicles[rival].values()
        theta = jnp.stack([values[row.name] for row in vehicle.layout.free])
        if moved is None:
            return theta, self.starts[rival]
        numbers, state = jnp.split(moved, [len(theta)])
        return theta + _size(theta) * numbers, self.starts[rival] + self.spreads[rival] * state

    def _answer(
        self, rival: int, runs: Runs, theta: Array, start: Array
    ) -> tuple[Float[Array, "k s"], Float[Array, "k c"]]:
        """States and outputs, SI."""
        names = [row.name for row in self.vehicles[rival].layout.free]
        vehicle = self.vehicles[rival].with_values(dict(zip(names, theta, strict=True)))
        states = Sampled.of(vehicle, runs).states(runs, start)
        return states[0], vehicle.measure(runs.times, states, runs.signals)[0]

    def _refitted(self, runs: Runs) -> tuple[Float[Array, "r r"], list[Array], list[Array]]:
        """χ² of all pairs; for each rival and truth the changes β (p + s), in its units, and the misfit (K, c)."""
        columns, betas, misfits, both = [], [], [], []
        still = [jnp.zeros(len(prior) + len(spread)) for prior, spread in zip(self.priors, self.spreads, strict=True)]
        for i, zero in enumerate(still):
            shown = lambda y, i=i: self._answer(i, runs, *self._at(i, y))[1]
            value, tangent = jax.linearize(shown, zero)
            both.append((value, jax.vmap(tangent, out_axes=-1)(jnp.eye(len(zero))) * self.weight[:, None]))
        for rival, (own, by) in enumerate(both):
            difference = jnp.stack([self.vehicles[rival].deviation(other, own) * self.weight for other, _ in both])
            size = _size(self._at(rival)[0])
            known = jnp.concatenate([size / self.priors[rival], jnp.ones(len(self.spreads[rival]))])
            beta = _nearest(by.reshape(-1, len(known)), known, difference)
            misfit = difference - jnp.einsum("kcq,aq->akc", by, beta)
            chi_square = jnp.sum(misfit**2, axis=(1, 2)) + jnp.sum((beta * known) ** 2, axis=1)
            columns.append(chi_square.at[rival].set(jnp.inf))
            betas.append(beta)
            misfits.append(misfit)
        return jnp.stack(columns, axis=1), betas, misfits

    def _most(self, states: list[Array], runs: Runs) -> Float[Array, "k c1"]:
        used = [
            jnp.abs(self.bounds.used(vehicle, path, runs.signals[0]))
            for vehicle, path in zip(self.vehicles, states, strict=True)
        ]
        most = jnp.max(jnp.stack(used), axis=0)
        return jnp.where(jnp.isfinite(most), most, jnp.inf)


def loss(free: Float[Array, "k m"], rivals: Rivals) -> Float[Array, ""]:
    """Minus the logarithm of a smooth minimum of the separations, and the penalty of channels outside their limits."""
    apart, excess = rivals.worth(rivals.bounds.inputs(free))
    other = ~jnp.eye(len(apart), dtype=bool)
    logs = jnp.log(jnp.where(other, apart, 1.0) + _NONE)
    nearest = -jax.nn.logsumexp(-_SHARP * logs, where=other) / _SHARP
    return _PENALTY * jnp.sum(jnp.maximum(excess - _MARGIN, 0.0) ** 2) - nearest


def _size(theta: Float[Array, " p"]) -> Float[Array, " p"]:
    """The unit in which free numbers are moved: their own size."""
    return jnp.where(theta == 0.0, 1.0, jnp.abs(theta))


def _nearest(by: Float[Array, "n q"], known: Float[Array, " q"], apart: Float[Array, "a k c"]) -> Float[Array, "a q"]:
    """The changes β that bring a rival nearest to each of the differences."""
    length = jnp.sqrt(jnp.sum(by**2, axis=0) + known**2)
    length = jnp.where(length > 0.0, length, 1.0)
    unit, prior = by / length, known / length
    gram = unit.T @ unit + jnp.diag(prior**2 + _UNTOLD)
    return cho_solve(cho_factor(gram), unit.T @ apart.reshape(len(apart), -1).T).T / length
