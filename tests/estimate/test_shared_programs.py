"""What a search needs beside simulations is the same for every model with as many free numbers, and compiled once."""

import jax
from rigs import oscillator, recorded

from jaxsub.effects import CubicStiffness, QuadraticDamping
from jaxsub.estimate import fit

# states at the samples, Jacobians along them, and the inertia
OF_A_MODEL = 3


def programs_of(model, runs) -> int:
    """How many programs are compiled, or read from the cache, for a fit."""
    made = []
    note = lambda event, *_, **__: event.endswith("backend_compile_duration") and made.append(event)
    jax.monitoring.register_event_duration_secs_listener(note)
    assert fit(model, runs).converged
    jax.monitoring.unregister_event_duration_listener(note)
    return len(made)


def test_a_fit_of_another_structure_compiles_only_its_equations():
    """Claim: after a fit with a quadratic damping, one with a cubic spring makes three programs and no more."""
    jax.clear_caches()
    plain = oscillator()
    runs = recorded(plain, 2, 80, 0.1, 3)
    first = programs_of(plain.with_effect(QuadraticDamping("x", -0.01)), runs)
    second = programs_of(plain.with_effect(CubicStiffness("x", -0.01)), runs)
    assert first > 2 * OF_A_MODEL
    assert second <= OF_A_MODEL
