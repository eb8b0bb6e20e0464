r"""Equivalent systems: other coefficients under which a vehicle shows the same outputs for any input.

The paper (section 3) writes the velocities as $\nu = P\nu_1$. Then $\tilde M_1 = \tilde MP$, $\tilde A_1 = \tilde AP$
and $C_1 = CP$ have the same likelihood, and inertia and damping drift together (its eq. 6). Its linear model has
nothing to hold that against; a vehicle has known entries, sensors and kinematics. Here, besides $P$, an equation may be
multiplied and mixed with others ($T$), unmeasured positions may be read as $\eta = Q\eta_1$, and either be shifted:

$\nu = P\nu_1 + c_\nu,\quad \eta = Q\eta_1 + c_\eta,\quad \tilde M_1 = T\tilde MP,\quad
 f_1(\nu_1, \eta_1, \delta) = T f(\nu, \eta, \delta)$ with $f$ damping and all other forces.

With $g = (\tilde M^{-1}f, \dot\eta)$ the rates of the state x, h the measured channels and $x = Sx_1 + c$,
$S = \mathrm{diag}(P, Q)$, a system of coefficients $\theta_1$ is equivalent when for every state and input

$g(x_1; \theta_1) = S^{-1} g(Sx_1 + c; \theta),\qquad h(x_1; \theta_1) = h(Sx_1 + c; \theta)$,

and $T = \tilde M_1 P^{-1}\tilde M^{-1}$ need not be searched for. Only states count that the outputs feel, at once or
through other states. At $\theta_1 = \theta$ this is a homogeneous linear system in $(d\theta, dS, c)$; its null space
holds the families. $P$ is the paper's; $T$, $Q$ and the shifts are additions.
"""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..programs import compiled
from ..simulation.synthesis import at_rest
from ..vehicle import AbstractVehicle
from .conditions import Change, Conditions, Equivalent

# entries of a null vector below this, in their units, are rounding
_ZERO = 1e-6


@dataclasses.dataclass(frozen=True)
class Family:
    """A direction in which coefficients drift together without any output noticing, whatever the input.

    **Fields**

    - `leading`: the entry that the family's parameter t is: `P[v,p]`, `T[sway,yaw]`, `shift[u]`, or a coefficient (then
      t is its relative change).
    - `coefficients`: change of each coefficient that takes part, physical units per unit of t.
    - `reinterpreted`: states that the members read differently; measuring one of them breaks the family.
    - `tangent`: dθ, dS, c and dT per unit of t.
    """

    leading: str
    coefficients: dict[str, float]
    reinterpreted: tuple[str, ...]
    tangent: Change
    conditions: "Conditions" = dataclasses.field(repr=False)

    def member(self, t: float) -> Equivalent:
        """The equivalent system at `t`: exact, the tangent is corrected by Newton's method.

        **Raises** `InputError` where the family does not reach that far.
        """
        flat = jnp.concatenate([self.tangent.theta, self.tangent.S.ravel(), self.tangent.shift])
        return self.conditions.solve(t * self.conditions.scaled(flat), self.leading)

    def sentence(self) -> str:
        """The family in words."""
        terms = ", ".join(f"{name} {change:+.4g} t" for name, change in self.coefficients.items())
        read = f"; {', '.join(self.reinterpreted)} read differently" if self.reinterpreted else ""
        return f"{self.leading} = t leaves every output as it is: {terms}{read}"


def equivalent_systems(vehicle: AbstractVehicle) -> list[Family]:
    """The families of systems equivalent to `vehicle`, a basis of their tangents; each is led by one entry of P, Q, T.

    Structural: they follow from what is free, known and measured, not from any recording.
    """
    p = len(vehicle.layout.free)
    if not p:
        return []
    conditions = Conditions.of(vehicle)
    jacobian = np.asarray(conditions.jacobian(jnp.zeros(conditions.width)))
    _, singular, rows = np.linalg.svd(np.linalg.qr(jacobian, mode="r"))
    null = rows[np.sum(singular > np.sqrt(np.finfo(jacobian.dtype).eps) * singular[0]) :]
    # a mere symmetry of the state changes no coefficient and is no family
    turned, sizes, _ = np.linalg.svd(null[:, :p], full_matrices=False)
    null = turned[:, sizes > _ZERO].T @ null
    return _families(conditions, null) if len(null) else []


def _families(conditions: Conditions, null: np.ndarray) -> list[Family]:
    """The null space as families, each led by an entry that no other has."""
    vehicle = conditions.vehicle
    states, equations = vehicle.layout.states, vehicle.layout.equations
    names = [row.name for row in vehicle.layout.free]
    p, s, n = len(names), len(states), len(equations)
    labels = names + [f"{'P' if i < n else 'Q'}[{states[i]},{states[j]}]" for i in range(s) for j in range(s)]
    labels += [f"shift[{state}]" for state in states] + [f"T[{a},{b}]" for a in equations for b in equations]
    unit = _units(conditions)
    changes = np.asarray(_flattened(conditions, jnp.asarray(null)))
    rows, leads = _echelon(changes / unit, [slice(p, p + s * s + s), slice(p + s * s + s, None), slice(0, p)])
    families = []
    for row, lead in zip(rows, leads, strict=True):
        # t is the leading entry itself, or of a coefficient its relative change
        physical = (
            np.where(np.abs(row) > _ZERO * np.abs(row).max(), row, 0.0) * unit / (1.0 if lead < p else unit[lead])
        )
        theta, S, shift, T = np.split(physical, [p, p + s * s, p + s * s + s])
        S, T = S.reshape(s, s), T.reshape(n, n)
        read = tuple(state for state, entries, c in zip(states, S, shift, strict=True) if entries.any() or c)
        changed = {name: float(d) for name, d in zip(names, theta, strict=True) if d}
        tangent = Change(*(jnp.asarray(part) for part in (theta, S, shift, T)))
        families.append(Family(labels[lead], changed, read, tangent, conditions))
    return families


def _units(conditions: Conditions) -> np.ndarray:
    """What counts as a change of one in dθ, dS, c and dT, in a row."""
    vehicle = conditions.vehicle
    theta = np.abs([float(vehicle.values()[row.name]) for row in vehicle.layout.free])
    rms = np.sqrt(np.mean((np.asarray(conditions.states) - np.asarray(at_rest(vehicle, 1))) ** 2, 0))
    mass = np.abs(np.diag(np.asarray(vehicle.mass_matrix())))
    force = mass * rms[: len(mass)]
    between = lambda size: np.outer(size, 1.0 / size).ravel()
    return np.concatenate([np.where(theta == 0.0, 1.0, theta), between(rms), rms, between(force)])


@compiled
def _flattened(conditions: Conditions, null: Float[Array, "f u"]) -> Float[Array, "f e"]:
    """dθ, dS, c and dT in a row for each vector of the null space, physical units."""

    def flat(unknowns: Array) -> Array:
        theta, S, shift = conditions.change(unknowns)
        return jnp.concatenate([theta, S.ravel(), shift, conditions.mixing(theta, S).ravel()])

    zero = jnp.zeros(conditions.width)
    return jax.vmap(lambda vector: jax.jvp(flat, (zero,), (vector,))[1])(null)


def _echelon(rows: np.ndarray, groups: list[slice]) -> tuple[np.ndarray, list[int]]:
    """Gauss-Jordan form of `rows`, led by columns of the first group as long as there are any, and so on."""
    rows, leads = rows.copy(), []
    for step in range(len(rows)):
        rows[step:] /= np.abs(rows[step:]).max(axis=1, keepdims=True)
        left = np.abs(rows[step:])
        group = next(g for g in groups if left[:, g].max(initial=0.0) > _ZERO)
        which, column = np.unravel_index(np.argmax(left[:, group]), left[:, group].shape)
        column = int(column) + group.start
        rows[[step, step + which]] = rows[[step + which, step]]
        rows[step] /= rows[step, column]
        others = np.arange(len(rows)) != step
        rows[others] -= np.outer(rows[others, column], rows[step])
        leads.append(column)
    return rows, leads
