"""Functions on JAX arrays as CasADi functions and as C: for optimisers and processors that have no JAX."""

from ..errors import InputError

try:
    import casadi as casadi
except ImportError as missing:
    raise InputError("casadi", "is not installed", "run pip install 'jaxsub[control]'") from missing

from .code import Native, compiled, write_c
from .translate import casadi_function

__all__ = ["Native", "casadi_function", "compiled", "write_c"]
