"""Predictive control: the inputs over a horizon that bring channels to their references within limits."""

from collections.abc import Mapping

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Bool, Float, Int

from ..effects.motion import PROPULSION
from ..errors import InputError, require_known
from ..information.design_limits import producible
from .equilibrium import Trim, require_trim, trim
from .limits import FinLimits
from .mpc_problem import Task, Weights
from .plant import Plant
from .sequential import Sequential

# m and rad: as large as an operator would forgive
_SCALE = {"z": 0.5, "psi": 0.09}


class MpcPlan(eqx.Module):
    """What the controller remembers from sample to sample.

    **Fields**

    - `nodes`: (d,) the inputs it planned, in units of their amplitudes. `last`: (m,) the inputs that it gave, SI.
    """

    nodes: Float[Array, " d"]
    last: Float[Array, " m"]


class Solved(eqx.Module):
    """How a sample's problem was solved.

    **Fields**

    - `cost`: J of the plan, without a unit. `promised`: what another step would gain, in parts of 1 + J.
    - `passed`: (2,) the most by which it passes a limit of inputs and of channels, in parts of the limit; zero where it
      does not. `steps`: how many it took.
    - `finite`: whether the prediction is; if not, the inputs stay what they were.
    """

    cost: Float[Array, ""]
    promised: Float[Array, ""]
    passed: Float[Array, "2"]
    steps: Int[Array, ""]
    finite: Bool[Array, ""]


class Mpc(eqx.Module):
    """A predictive controller on a plant.

    Each sample it minimises J of `mpc_problem` over the inputs ahead, from the last plan one sample on, and gives the
    first of them. A plan keeps the limits of inputs and rates at every step of the search, so that one that is cut
    short gives inputs that may be used. One program does for all samples.

    **Fields**

    - `plant`, `weights`, `nodes`: as in `Task`.
    - `tolerance`: the gain, in parts of 1 + J, below which a search ends; `most`: steps after which it does.
    """

    plant: Plant
    weights: Weights
    nodes: tuple[int, ...] = eqx.field(static=True)
    tolerance: float = eqx.field(static=True)
    most: int = eqx.field(static=True)

    @classmethod
    def of(
        cls,
        plant: Plant,
        track: Mapping[str, float] | None = None,
        within: Mapping[str, tuple[float, float]] | None = None,
        *,
        limits: FinLimits | Mapping[str, FinLimits] | None = None,
        rest: Trim | None = None,
        horizon: float = 15.0,
        free: int = 8,
        effort: float = 0.5,
        pace: float = 0.5,
        give: float = 1e-4,
        tolerance: float = 1e-4,
        steps: int = 8,
    ) -> "Mpc":
        """A controller that brings the channels `track` of `plant` to their references over a `horizon` in s.

        `track` gives the deviation of each that costs one for a second, SI, by default 0.5 m of `z` and 0.09 rad of
        `psi`, those that the plant has. `within` bounds channels, SI; one that passes its bound by the root of `give`,
        in parts of half the range, costs ½ a sample. `limits` are those of every fin, by default `FinLimits.of()`, or
        one for each input by name; `effort` and `pace` the parts of amplitude and rate that cost one for a second.
        Inputs are `free` at as many samples, closer together at first. They rest, at no cost, where the plant is in the
        trim `rest`, by default that of `trim` with nothing wanted. A sample takes at most `steps` steps of the solver,
        which ends where one promises less than `tolerance` of 1 + J.

        **Raises** `InputError` for no channel or one that the vehicle has not, an empty range, an input without finite
        limits, and a plant without trim.
        """
        layout = plant.vehicle.layout
        track = {n: _SCALE[n] for n in ("z", "psi") if layout.tells(n)} if track is None else track
        within = {} if within is None else within
        if not track:
            raise InputError("mpc: track", "names no channel", 'give { "speed": 0.1 } and the like')
        require_known("mpc: channel", (*track, *within), producible(plant.vehicle), layout.name)
        for name, (low, high) in within.items():
            if not low < high:
                raise InputError(f"mpc: within {name!r}", f"{low:g} to {high:g} is empty", "give the lesser first")
        count = max(round(horizon / plant.dt), 2)
        nodes = tuple(int(n) for n in np.unique(np.round(np.geomspace(1.0, count, free)) - 1.0))
        amplitude, rate = _limits(plant, limits)
        columns = lambda values: jnp.asarray(list(values), plant.constants.dtype)
        weights = Weights(
            tuple(track), columns(track.values()), effort * amplitude, pace * rate,
            require_trim(plant, trim(plant) if rest is None else rest).u,
            amplitude, rate, tuple(within), columns(low for low, _ in within.values()),
            columns(high for _, high in within.values()), columns([give])[0],
            tuple(layout.is_angle(name) for name in track),
        )  # fmt: skip
        return cls(plant, weights, nodes, tolerance, steps)

    @property
    def samples(self) -> int:
        """Samples of the horizon."""
        return self.nodes[-1] + 1

    def start(self, inputs: Float[Array, " m"]) -> MpcPlan:
        """Before the first sample, the inputs being `inputs`."""
        return MpcPlan(jnp.tile(inputs / self.weights.amplitude, len(self.nodes)), inputs)

    def task(
        self,
        plan: MpcPlan,
        x: Float[Array, " s"],
        reference: Float[Array, "n t"],
        time: Float[Array, ""] | float = 0.0,
    ) -> Task:
        """The optimisation problem of one sample; arguments as of `command`.

        `plan` is the last one, `x` (s,) the state, `reference` (n, t) that of the tracked channels at the samples after
        this one, all SI, and `time` that of the sample, s.
        """
        return Task(self.plant, self.weights, self.nodes, x, plan.last, reference, jnp.asarray(time, x.dtype))

    def command(
        self,
        plan: MpcPlan,
        x: Float[Array, " s"],
        reference: Float[Array, "n t"],
        time: Float[Array, ""] | float = 0.0,
    ) -> tuple[MpcPlan, Float[Array, " m"], Solved]:
        """The plan one sample on, the inputs to give now (m,), SI, and how they were found.

        `plan` is the one of the sample before. `x` (s,) is the state, or an observer's estimate of it; `reference` (n,
        t) that of the tracked channels at the `samples` after this one, SI; `time` that of the sample, s.
        """
        task = self.task(plan, x, reference, time)
        y, solved = self.solve(task, plan.nodes)
        planned, weights = task.inputs(y), self.weights
        limits = FinLimits(weights.amplitude, weights.rate)
        # the search keeps the limits to its own rounding
        u = jnp.where(solved.finite, limits.apply(planned[0], plan.last, self.plant.dt), plan.last)
        later = jnp.minimum(jnp.array(self.nodes) + 1, self.samples - 1)
        on = MpcPlan((planned[later] / weights.amplitude).ravel(), u)
        return jax.tree.map(lambda a, b: jnp.where(solved.finite, a, b), on, self.start(u)), u, solved

    def solve(self, task: Task, y: Float[Array, " d"]) -> tuple[Float[Array, " d"], Solved]:
        """The solution of `task`, searched from the coordinates `y` (d,); it keeps the limits of inputs and rates."""
        solver = Sequential(Task.expand, self.tolerance)
        found = optx.minimise(lambda y, task: task.cost(y), solver, y, task, max_steps=self.most + 1, throw=False)
        y, cost = found.value, found.state.cost
        passed = jnp.stack([jnp.max(g, initial=0.0) for g in task.limits(y)])
        finite = jnp.isfinite(cost) & jnp.all(jnp.isfinite(y))
        return y, Solved(cost, found.state.promised, passed, jnp.asarray(found.stats["num_steps"]), finite)


def _limits(
    plant: Plant, limits: FinLimits | Mapping[str, FinLimits] | None
) -> tuple[Float[Array, " m"], Float[Array, " m"]]:
    """Amplitude and rate of each input; what is given for fins is not for propulsion."""
    whole = FinLimits.of() if limits is None else limits
    rows = []
    for name in plant.inputs:
        given = whole.get(name) if isinstance(whole, Mapping) else None if name in PROPULSION else whole
        if given is None or not bool(jnp.isfinite(given.amplitude) & jnp.isfinite(given.rate)):
            where = f"{plant.vehicle.layout.name}: input {name!r}"
            raise InputError(where, "has no finite limits of amplitude and rate", "give it FinLimits by its name")
        rows.append((given.amplitude, given.rate))
    table = jnp.asarray(rows, plant.constants.dtype).reshape(-1, 2)
    return table[:, 0], table[:, 1]
