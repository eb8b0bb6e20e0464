r"""The modified extended Kalman filter: two filters in parallel (the first paper's section 5).

I is the optimal Kalman filter of the state with $\hat\theta_{k-1}$ taken as known. II is the extended Kalman filter of
$[x, \theta]$, linearised about ($\hat x$ of I, $\hat\theta_{k-1}$); it returns $\hat\theta_k$ to I, and what it makes
of the state is not used. Source: Chui, Chen and Chui (1990), IEEE Trans. Automatic Control 35.
"""

import dataclasses

import jax.numpy as jnp
from jaxtyping import Array, Float

from .ekf import AbstractFilter, FilterState, augmented_predict, augmented_widened
from .form import AbstractForm, SquareRoot
from .gate import AbstractGate, Open
from .model import AbstractProcess, Sample
from .noise import AbstractNoiseRule, Innovation, Residuals


class ModifiedKalmanFilter(AbstractFilter):
    """Filters I and II on one state: `own` is the uncertainty of I, `joint` that of II."""

    process: AbstractProcess
    noise: AbstractNoiseRule
    R_root: Float[Array, "c c"]
    x_root: Float[Array, "s s"]
    form: AbstractForm = SquareRoot()
    gate: AbstractGate = Open()

    def own(self) -> Float[Array, "s s"]:
        """Filter I starts with the same uncertainty of the state as filter II."""
        return self.form.start(self.x_root)

    def predict(self, state: FilterState, sample: Sample, G: Float[Array, "s m"]) -> FilterState:
        """Both filters step from the same state and parameters."""
        x, joint, F = augmented_predict(self, state, sample, G)
        assert state.own is not None
        return dataclasses.replace(state, x=x, joint=joint, own=self.form.predict(state.own, F, G))

    def widened(self, state: FilterState, G: Float[Array, "s m"]) -> FilterState:
        """The measurement update of both filters."""
        assert state.own is not None
        own = self.form.predict(state.own, jnp.eye(len(state.own), dtype=G.dtype), G)
        return dataclasses.replace(state, joint=augmented_widened(self, state, G), own=own)

    def correct(self, state: FilterState, seen: Innovation) -> tuple[FilterState, Float[Array, "c c"]]:
        """I corrects the state and II the parameters, from one innovation."""
        s = len(self.x_root)
        assert state.own is not None
        gain, factor, own = self.form.update(state.own, seen.C[:, :s], seen.R_root, seen.mask)
        joint_gain, joint_factor, joint = self.form.update(state.joint, seen.C, seen.R_root, seen.mask)
        correction = gain @ seen.value
        residuals = Residuals(seen.value, seen.mask, factor, gain, correction)
        x, theta = self.process.moved(state.x, correction), state.theta + joint_gain[s:] @ seen.value
        after = dataclasses.replace(state, x=x, theta=theta, joint=joint, own=own, residuals=residuals)
        return after, joint_factor
