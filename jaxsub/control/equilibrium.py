r"""Trim: the state and the inputs at which a plant stays as it is, found by optimistix and differentiable.

With w the velocities, the attitude, the memories of effects and the inputs, and with the place and the heading given,
$F(w) = [\dot x(w),\; c(w) - c^*] = 0$: what the sampled step changes in the first four, per s, and channels or inputs
that are wanted. Derivatives are those of the implicit function, $dw = -F_w^{-1}F_\theta\,d\theta$.
"""

from collections.abc import Mapping

import equinox as eqx
import jax.numpy as jnp
import optimistix as optx
from jaxtyping import Array, Float

from ..errors import InputError, require_known
from ..information.design_limits import producible
from ..programs import compiled
from .plant import Plant, Time

# what moves a body only through effects that follow it
_PLACE = ("x", "y", "z", "psi")
# what is wanted of a body where nothing else is said: in whose place, and with which state
_LEVEL = (("depth_rate", "theta", "z"), ("heading_rate", "r", "psi"), ("phi", "p", "phi"))
_TOLERANCE, _STEPS = 1e-10, 64


class Trim(eqx.Module):
    """Where a plant is in equilibrium.

    **Fields**

    - `x`: (s,) the plant's state, SI; `u`: (m,) its inputs, SI.
    - `residual`: the largest rate or deviation that is left, SI.
    - `result`: what became of the search. A failure is a value, also under vmap; `require_trim` makes it an error.
    """

    x: Float[Array, " s"]
    u: Float[Array, " m"]
    residual: Float[Array, ""]
    result: optx.RESULTS


def trim(
    plant: Plant,
    wanted: Mapping[str, Float[Array, ""] | float] | None = None,
    at: Mapping[str, Float[Array, ""] | float] | None = None,
    *,
    time: Time = 0.0,
) -> Trim:
    """The steady motion of `plant` in which channels and inputs have the values `wanted`, SI, at `time` in s.

    Each input needs a condition. While there are fewer, a body is wanted level (`depth_rate` zero, unless there is a
    `theta`), straight (`heading_rate`, unless there is an `r`) and upright (`phi`), in that order. Of a mechanism or a
    model nothing wanted means inputs of zero. `at` gives a body's place (m) and heading (rad), elsewhere zero.

    **Raises** `InputError` for a name that is unknown and for a number of conditions that does not fit.
    """
    wanted, at = _conditions(plant, wanted or {}, at or {})
    states = plant.states[: plant.own]
    moving = [i for i, name in enumerate(states) if not _is_place(plant, name)]
    state = jnp.zeros(len(states), plant.constants.dtype)
    if "u" in states and plant.vehicle.layout.kind == "submerged-body":
        state = state.at[states.index("u")].set(plant.vehicle.own_values()["speed"])
    for name, value in at.items():
        state = state.at[states.index(name)].set(value)
    names = tuple(name for name in wanted if name not in plant.inputs)
    names += tuple(name for name in wanted if name in plant.inputs)
    targets = jnp.stack([jnp.asarray(wanted[name], state.dtype) for name in names])
    return _found(plant, state, targets, jnp.asarray(time, state.dtype), names, tuple(moving))


@compiled
def _found(
    plant: Plant, state: Array, targets: Array, time: Array, names: tuple[str, ...], moving: tuple[int, ...]
) -> Trim:
    """The trim in which `names` have the values `targets`, the `moving` states being free."""
    free = jnp.array(moving)

    def missing(w: Array, args: tuple[Plant, Array, Array, Array]) -> Array:
        plant, state, targets, time = args
        own, u = state.at[free].set(w[: len(moving)]), w[len(moving) :]
        x = plant.start(own, u, time)
        rates = (plant.step(x, u, time)[: plant.own] - own) / plant.dt
        known = plant.channels(x, u, time) | dict(zip(plant.inputs, u, strict=True))
        return jnp.concatenate([rates[free], jnp.stack([known[name] for name in names]) - targets])

    args = (plant, state, targets, time)
    start = jnp.concatenate([state[free], jnp.zeros(len(plant.inputs), state.dtype)])
    solver = optx.LevenbergMarquardt(rtol=_TOLERANCE, atol=_TOLERANCE)
    found = optx.root_find(missing, solver, start, args, max_steps=_STEPS, throw=False)
    own, u = state.at[free].set(found.value[: len(moving)]), found.value[len(moving) :]
    residual = jnp.max(jnp.abs(missing(found.value, args)))
    return Trim(plant.start(own, u, time), u, residual, found.result)


def require_trim(plant: Plant, found: Trim, tolerance: float = 1e-6) -> Trim:
    """`found`, a trim of `plant`. **Raises** `InputError` where more than `tolerance` (SI) is left: none was found."""
    if not float(found.residual) < tolerance:
        what = f"has no trim as wanted: {float(found.residual):.2g} (SI) of its rates and conditions is left"
        raise InputError(plant.vehicle.layout.name, what, "want another speed or attitude, or free another input")
    return found


def _conditions(
    plant: Plant, wanted: Mapping[str, Float[Array, ""] | float], at: Mapping[str, Float[Array, ""] | float]
) -> tuple[dict[str, Array | float], Mapping[str, Array | float]]:
    """What is wanted, with straight and level flight, or inputs of zero, where nothing is said; as many as it takes."""
    layout = plant.vehicle.layout
    body = layout.kind == "submerged-body"
    full: dict[str, Array | float] = dict(wanted)
    for name, instead, position in _LEVEL if body else ():
        if len(full) < len(plant.inputs) and layout.tells(position) and instead not in full:
            full.setdefault(name, 0.0)
    if not body and not full:
        full = dict.fromkeys(plant.inputs, 0.0)
    short = len(plant.inputs) - len(full)
    require_known("trim: wanted", full, (*producible(plant.vehicle), *plant.inputs), layout.name)
    require_known("trim: at", at, [name for name in plant.states if _is_place(plant, name)], layout.name)
    if short != 0:
        has = f"has {len(plant.inputs)} inputs for {len(full)} conditions ({', '.join(full) or 'none'})"
        remedy = f"want {short} more" if short > 0 else f"hold {-short} fewer, or give the plant more inputs"
        raise InputError(f"trim: {layout.name}", has, remedy)
    return full, at


def _is_place(plant: Plant, name: str) -> bool:
    return plant.vehicle.layout.kind == "submerged-body" and name in _PLACE
