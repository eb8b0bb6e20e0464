"""What a sweep is going to do: its axes, the number of each search, what is drawn for it, and the chunks it is done in.

A *case* is one vehicle on one set of recordings. Within a case search n has start `n % starts` and noise
`n // starts`. What is drawn for it depends on the seed and on its own place on each axis, so that however a sweep is
split, or lengthened along an axis, the same place is given the same draws.
"""

import dataclasses
import functools
from collections.abc import Mapping, Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..errors import InputError
from ..estimate import METHODS, Problem, batch, search
from ..estimate.between_runs import unknown_spreads
from ..estimate.method import share_for
from ..estimate.starts import scattered_by_number
from ..recording import Recording
from ..vehicle import AbstractVehicle

# files in a folder that every notebook still opens at once
_FILES = 500
_STARTS, _NOISE = 0, 1
# methods that need no more than a problem on C gives
_ON_C = ("gauss_newton", "nelder_mead")
# the random numbers are those of this generator, whichever a program may have chosen for itself
_GENERATOR = "threefry2x32"


@dataclasses.dataclass(frozen=True)
class Chunk:
    """Searches `first` to `last`, the latter not included, of the case numbered `case`: what is done and kept whole."""

    case: int
    first: int
    last: int


@dataclasses.dataclass(frozen=True, eq=False)
class Plan:
    """Monte-Carlo over initial guesses, noise, vehicles and recordings; every combination is one search.

    **Fields**

    - `vehicles`: by name; each one's own values are where its starts are drawn about.
    - `recordings`: sets by name; those in one set are fitted together.
    - `starts`: how many initial guesses. `spread`: each coefficient is drawn within ± this share of its value,
      so that one of zero stays there.
    - `noise`: seeds. Each stands for a recording of its own: the outputs in `recordings`, which then have to be
      without noise (`synthetic(..., noise=False)`, `answered`), plus white noise of each channel's sigma. Where there
      is no seed the outputs are taken as they are.
    - `seed`: of all draws. `method`: a name in `estimate.METHODS`.
    - `sigma`: (c,) noise of the channels for each case, SI; that of the vehicle file where it is None.
    - `width`: searches in a chunk, for each case; as `chunk_width` has it where it is None.
    - `compiled`: whether each worker makes C of its problems (`Problem.in_c`): the same answers, many times faster,
      where the method takes no further derivatives.

    **Raises** `InputError` for an axis without a value, for a method that there is not and for one that C cannot serve.
    """

    vehicles: Mapping[str, AbstractVehicle]
    recordings: Mapping[str, Sequence[Recording]]
    starts: int
    spread: float = 0.5
    noise: Sequence[int] = ()
    seed: int = 0
    method: str = "gauss_newton"
    sigma: Sequence[Sequence[float]] | None = None
    width: Sequence[int] | None = None
    compiled: bool = False

    def __post_init__(self):
        for axis, size in {"vehicles": len(self.vehicles), "recordings": len(self.recordings)}.items():
            if not size:
                raise InputError(f"sweep: {axis}", "there are none", "give at least one")
        if self.starts < 1:
            raise InputError("sweep: starts", f"is {self.starts}", "give 1 or more")
        if not 0.0 <= self.spread < np.inf:
            raise InputError("sweep: spread", f"is {self.spread}", "give 0 or more: 0.5 draws within ±50 %")
        if len(set(self.noise)) < len(self.noise) or any(not 0 <= seed < 2**31 for seed in (*self.noise, self.seed)):
            raise InputError("sweep: seeds", "are not different numbers from 0 to 2³¹ - 1", "give others")
        if self.method not in METHODS:
            raise InputError("sweep: method", f"there is no {self.method!r}", f"choose among {', '.join(METHODS)}")
        if self.compiled and self.method not in _ON_C:
            raise InputError("sweep: method", f"{self.method} takes derivatives that C has not", f"choose {_ON_C[0]}")

    def __getstate__(self) -> dict:
        """Without the problems, which are made anew where they are wanted: their C is a machine's own."""
        return {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}

    @property
    def cases(self) -> list[tuple[str, str]]:
        """The names of each case's vehicle and recordings."""
        return [(vehicle, recorded) for vehicle in self.vehicles for recorded in self.recordings]

    @property
    def per_case(self) -> int:
        """Searches in a case."""
        return self.starts * max(1, len(self.noise))

    @functools.cached_property
    def problems(self) -> list[Problem]:
        """The fit of each case. Raises `InputError` for a recording that the vehicle cannot take."""
        made = []
        for index, (name, recorded) in enumerate(self.cases):
            vehicle = self.vehicles[name]
            if unknown := unknown_spreads(vehicle):
                what = f"how much {', '.join(unknown)} differs between runs is not known"
                raise InputError(f"sweep: vehicle {name}", what, "identify it first, or give spread = … beside varies")
            known = None if self.sigma is None else jnp.asarray(self.sigma[index])
            sigma = jnp.array([output.sigma or 1.0 for output in vehicle.layout.outputs]) if known is None else known
            problem = Problem.of(vehicle, batch(vehicle, self.recordings[recorded]), sigma)
            made.append(problem.in_c() if self.compiled else problem)
        return made

    def settled(self) -> "Plan":
        """The plan with the noise that a vehicle file leaves open, as one fit from the file's own values finds it."""
        if self.sigma is not None:
            return self
        sigma = []
        for (name, recorded), problem in zip(self.cases, self.problems, strict=True):
            known = problem.sigma
            if any(output.sigma is None for output in problem.vehicle.layout.outputs):
                found = search(problem.vehicle, problem.runs)
                if not bool(jnp.isfinite(found.cost)):
                    what = f"sigma is to be estimated and the model does not run on {recorded} from these values"
                    raise InputError(f"sweep: vehicle {name}", what, "give sigma, or values that are closer")
                known = found.sigma
            sigma.append(tuple(np.asarray(known).tolist()))
        return dataclasses.replace(self, sigma=tuple(sigma))

    def chunks(self) -> list[Chunk]:
        """The whole sweep in chunks, case after case."""
        widths = self.width or [self.chunk_width(problem) for problem in self.problems]
        ranges = [(case, first, width) for case, width in enumerate(widths) for first in range(0, self.per_case, width)]
        return [Chunk(case, first, min(first + width, self.per_case)) for case, first, width in ranges]

    def chunk_width(self, problem: Problem) -> int:
        """Searches in a chunk of `problem`: the shares that bound an estimator's memory, more in large sweeps."""
        share = share_for(problem)
        return share * -(-self.per_case * len(self.cases) // (share * _FILES))

    def start_points(self, case: int, numbers: np.ndarray) -> Float[Array, "n d"]:
        """The coordinates from which the searches `numbers` (n,) of a case start."""
        key = jax.random.fold_in(self._key(), _STARTS)
        return scattered_by_number(self.problems[case], self.spread, jnp.asarray(numbers % self.starts), key)

    def outputs(self, case: int, numbers: np.ndarray) -> Float[Array, "n r k c"] | None:
        """Recorded outputs (n, R, K, c), SI, of the searches `numbers` of `case`.

        None where all have those of the problem.
        """
        if not self.noise:
            return None
        problem, recorded = self.problems[case], case % len(self.recordings)
        runs, key = problem.runs, jax.random.fold_in(self._key(), _NOISE)

        def noisy(seed: Array) -> Array:
            own = jax.random.fold_in(jax.random.fold_in(key, seed), recorded)
            drawn = runs.outputs + problem.sigma * jax.random.normal(own, runs.outputs.shape)
            return jnp.where(runs.mask, drawn, 0.0)

        return jax.vmap(noisy)(jnp.asarray(np.asarray(self.noise)[numbers // self.starts]))

    def _key(self) -> Array:
        return jax.random.key(self.seed, impl=_GENERATOR)
