"""Physics that the vocabulary lacks: the right answer is `unknown`, and where."""

import jax.numpy as jnp

from .truth import Truth


def _outside(form: str, where: tuple[str, ...], limit: float, force, **memory) -> Truth:
    return Truth(f"outside: {form}", where[0], "outside", where, limit, force=force, **memory)


def _periodic(position: str, equation: str, number: float, limit: float) -> Truth:
    wave = lambda a, m: {equation: a * jnp.sin(number * m.positions[position] + 0.5)}
    return _outside(f"periodic in {position}", (equation,), limit, wave)


def _shedding(a, m):
    """Vortices at a Strouhal frequency of the speed, stronger in side-slip; the memory is their phase."""
    return {"sway": a * jnp.sin(m.memory[0]) * (0.1 + abs(m.rates["sway"])) * abs(m.rates["surge"])}


def _slosh(a, m):
    """A free surface in a tank across the hull, a pendulum little damped: its moment follows the liquid."""
    return {"roll": a * m.memory[0]}


def _slosh_rates(a, m):
    x, rate = m.memory
    return jnp.array([rate, -1.7 * x - 0.05 * rate + m.rates["roll"]])


def _one_sided(a, m):
    """Separation on one side of the hull alone, once the turn is faster than a threshold."""
    return {"yaw": -a * jnp.maximum(m.rates["yaw"] - 0.03, 0.0)}


def _bistable(a, m):
    """A wake that sits on one side or the other and flips with the roll angle."""
    return {"pitch": a * jnp.tanh(40.0 * jnp.sin(25.0 * m.positions["phi"]))}


OUTSIDE = (
    _periodic("psi", "yaw", 4.0, 3e3),
    _periodic("z", "heave", 2.5, 3e3),
    _outside("vortex shedding", ("sway",), 3e4, _shedding, memory=1,
             memory_rates=lambda a, m: 1.3 * jnp.stack([m.rates["surge"]])),
    _outside("sloshing", ("roll",), 1e5, _slosh, memory=2, memory_rates=_slosh_rates),
    _outside("one-sided separation", ("yaw",), 1e6, _one_sided),
    _outside("bistable wake", ("pitch",), 3e3, _bistable),
    _periodic("psi", "roll", 3.0, 3e3),
    _periodic("z", "pitch", 3.0, 3e3),
)  # fmt: skip
