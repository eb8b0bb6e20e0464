"""Terms that the equations of a user's own model may lack: constants, and products of its states and inputs."""

import itertools
import math
from collections.abc import Sequence
from typing import ClassVar

import equinox as eqx
from jaxtyping import Array

from ..errors import InputError, suggestion
from .base import AbstractForce, amplitude
from .motion import Facts, Motion, Signal

_CONSTANT = "1"


class PolynomialTerm(AbstractForce):
    r"""A term of a polynomial in the rate of one state: $\dot x_i \mathrel{+}= c$, $c\,x_j$ or $c\,a\,b$.

    $a$ and $b$ are states or inputs, the same twice or two; `product` writes them as `current*speed`, and `1` is the
    constant. An input alone is `thruster-cross-coupling`. For equations of a user's own, whose physics is not known;
    those of a body or a mechanism have effects with a cause.
    Source: Billings (2013), Nonlinear System Identification, §2.5; Brunton, Proctor and Kutz (2016), PNAS 113.
    """

    name: ClassVar[str] = "polynomial-term"
    family: ClassVar[str] = "mechanisms"
    equation: str = eqx.field(static=True)
    product: str = eqx.field(static=True)
    c: Array = amplitude("1")

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[PolynomialTerm]":
        """In each equation of a user's own model: the constant, its own state, and each product of two signals.

        Other states are left out: together their linear terms would stand for any small delay or lag.
        """
        if facts.kind != "model":
            return []
        signals = (*facts.equations, *facts.actuators)
        pairs = ["*".join(pair) for pair in itertools.combinations_with_replacement(signals, 2)]
        return [cls(equation, product) for equation in facts.equations for product in (_CONSTANT, equation, *pairs)]

    @property
    def where(self) -> tuple[str, ...]:
        """The one equation."""
        return (self.equation,)

    @property
    def expression(self) -> str:
        """The number and the product."""
        return "c" if self.product == _CONSTANT else f"c {self.product.replace('*', ' ')}"

    def force(self, motion: Motion) -> dict[str, Signal]:
        """The term along the motion. **Raises** `InputError` for a factor that is no state and no input."""
        signals = motion.positions | motion.actuators
        factors = [] if self.product == _CONSTANT else self.product.split("*")
        for name in factors:
            if name not in signals:
                remedy = suggestion(name, signals, f"write a product such as {'*'.join([*signals][:2])}")
                raise InputError(f"{self.label}: product", f"{name!r:.60} is no state and no input", remedy)
        # a constant has the shape of the motion too
        zero = 0.0 * motion.rates[self.equation]
        return {self.equation: self.c * math.prod(signals[name] for name in factors) + zero}
