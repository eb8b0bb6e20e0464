"""The same fit in jax-sysid, which trains any state-space model that is written in JAX by L-BFGS through the recording.

It knows neither priors nor sigmas by name: both go in as its custom loss and regularisation. Its steps are Runge and
Kutta's as a user writes them; fixed numbers of the model are closed over.
"""

import contextlib
import io
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax_sysid.models import Model  # pyright: ignore[reportMissingImports]

from ..case import Case
from . import equations
from .damped import End

_TRIG = (jnp.sin, jnp.cos)


def fit(case: Case, z: np.ndarray, epochs: int) -> End:
    """The end of `epochs` evaluations of L-BFGS from `z`; all runs, initial states free."""
    p, scale = len(case.names), np.abs(case.centre)
    spread = jnp.asarray(case.spread)

    def step(x: jax.Array, fins: jax.Array, params: list) -> jax.Array:
        values = {name: jnp.asarray(value) for name, value in case.values.items()}
        values |= {name: case.centre[i] + scale[i] * params[0][i] for i, name in enumerate(case.names)}
        inverse = jnp.linalg.inv(_filled(equations.mass_matrix(values)))
        linear = inverse @ _filled(equations.damping_matrix(values))

        def rates(x: jax.Array) -> jax.Array:
            push = inverse @ jnp.stack(equations.force(values, x, fins, _TRIG)) + linear @ x[:6]
            return jnp.concatenate([push, jnp.stack(equations.position_rates(x, _TRIG))])

        h, x = case.interval, x * spread
        k1 = rates(x)
        k2 = rates(x + 0.5 * h * k1)
        k3 = rates(x + 0.5 * h * k2)
        k4 = rates(x + h * k3)
        return (x + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)) / spread

    known = np.isfinite(case.prior_std)

    def prior(params: list, x0: jax.Array) -> jax.Array:
        theta = case.centre + scale * params[0]
        return 0.5 * jnp.sum((((theta - case.prior_mean) / case.prior_std)[known]) ** 2)

    weight = case.spread / case.sigma
    model: Any = Model(10, 10, 3, state_fcn=step, output_fcn=lambda x, u, params: x)
    model.init(params=[np.array(z[:p])], x0=[row / case.spread for row in case.guess])
    wide = lambda shown, measured: 0.5 * jnp.sum(((shown - measured) * weight) ** 2)
    model.loss(output_loss=wide, rho_x0=0.0, rho_th=0.0, custom_regularization=prior, xsat=1e6)
    model.optimization(adam_epochs=0, lbfgs_epochs=epochs, iprint=-1)
    with contextlib.redirect_stdout(io.StringIO()):
        model.fit([run / case.spread for run in case.measured], list(case.fins))
    starts = np.stack([np.asarray(x0) for x0 in model.x0]) - case.guess / case.spread
    return End(np.concatenate([np.asarray(model.params[0]), starts.ravel()]), float(model.Jopt), epochs)


def _filled(rows: equations.Matrix) -> jax.Array:
    return jnp.stack([jnp.stack([jnp.asarray(entry, float) for entry in row]) for row in rows])
