"""What a constraint between particles is: whom it joins, and the function C whose energy is 1/2 C^2/compliance."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

from softseam_services.body.body import Floats, Ints
from softseam_services.body.errors import ConstraintError
from softseam_services.body.particles import ParticleBody
from softseam_services.jit import PrototypeError

from .kernels.constraint import VALUE


class Joins(NamedTuple):
    """What m constraints of a kind join."""

    particles: Ints
    """(m, k)"""
    parameters: Floats
    """(m, n), as the constraint's function takes them"""
    compliance: Floats
    """(m,), of C squared a joule; 0 for a constraint that does not give"""


@dataclass(frozen=True)
class Constraint:
    """joins      which particles of a body a specification joins, and with which parameters
    value      C and its gradient, of what numba can compile
    one_sided  it holds C <= 0: it pulls where C is more, and lets go where C is less
    """

    joins: Callable[[Any, ParticleBody], Joins]
    value: Callable[..., float]
    one_sided: bool = False

    @cached_property
    def address(self) -> int:
        """Of the compiled function. Raises ConstraintError where it does not compile."""
        try:
            return VALUE.compile(self.value)
        except PrototypeError as error:
            raise ConstraintError(str(error)) from error
