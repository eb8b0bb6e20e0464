"""Forces of the water, the fins and the propeller that are products of motions and inputs."""

from collections.abc import Collection, Iterable

import equinox as eqx
from jaxtyping import Array, Float

from ..effects import Derivative, Motion, Power, Signal, derivative
from ..effects.derivatives import INPUT_SYMBOLS

ACTUATORS = tuple(INPUT_SYMBOLS)
_THRUST = Derivative("surge", (Power("thrust"),))


class Products(eqx.Module):
    r"""$\tau_i = \sum c\,x_1^{k_1}x_2^{k_2}\cdots$: every derivative that is neither linear damping nor added mass.

    Among them are constants such as `X_0`. `thrust` (N) pushes in surge as it is, where no `X_T` says otherwise.

    **Fields**

    - `coefficients`: SI, by symbol: `Y_delta_r`, `X_nn`, `Y_uv`, `Z_w|w|`.
    """

    coefficients: dict[str, Float[Array, ""]]

    def force(self, motion: Motion) -> dict[str, Signal]:
        """Generalised force by equation (N, N m), of the motion's shape."""
        total: dict[str, Signal] = {}
        products: dict[tuple[Power, ...], Signal | float] = {}
        terms = derivatives(self.coefficients)
        for name, value in self.coefficients.items():
            term = terms[name]
            # many derivatives of a hull are by the same product
            if term.powers not in products:
                products[term.powers] = term.product(motion)
            # no product by one: each operation is traced in every use of the model
            part = value * (products[term.powers] if term.sign > 0 else -products[term.powers])
            total[term.equation] = total.get(term.equation, 0.0) + part
        if "thrust" in motion.actuators and _THRUST not in terms.values():
            total["surge"] = total.get("surge", 0.0) + motion.actuators["thrust"]
        return total

    def by(self, name: str, inputs: Collection[str]) -> dict[str, Derivative]:
        """The derivatives, by symbol, that act through the input `name` where there are `inputs`."""
        terms = derivatives(self.coefficients)
        if "thrust" in inputs and _THRUST not in terms.values():
            terms[_THRUST.name] = _THRUST
        return {symbol: term for symbol, term in terms.items() if name in term.through(inputs)}

    @property
    def damp(self) -> bool:
        """Whether any of them follows a velocity."""
        return any(term.moved for term in derivatives(self.coefficients).values())


def derivatives(names: Iterable[str]) -> dict[str, Derivative]:
    """Of each of `names` that is a symbol of the grammar, what it says."""
    return {name: found for name in names if (found := derivative(name)) is not None}
