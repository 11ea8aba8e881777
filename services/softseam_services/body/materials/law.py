"""A material law: what a file of this package brings, and what an extension adds to the table of them.

A law is written in the invariants of `invariants`: response(i1, i2, j, parameters) returns psi and its nine
derivatives. softseam's own are branches in `point`, which the compiler puts in line; `linear` and `corotated` have
kernels of their own there. A law from outside is compiled alone, and kernels call it through its address (`jit`).

A law with state remembers n numbers where it is, zero at first. Its respond(F, state, dt, parameters, P, A, following)
is of the end of a step dt that began with that state: it returns psi, which is what it stores, and what the step
dissipated, both by volume; and it fills P (3, 3), A = dP/dF (9, 9), symmetric, with rows 3 i + j, and the state that
follows. With dt = 0 nothing is to change, and nothing to dissipate: so stress is read between steps.
What a step does is found where it ends, so that over a step the work P : dF is what is stored more and dissipated, but
for what the integrator errs by.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from softseam_services.body.body import Floats
from softseam_services.body.elastic_constants import ElasticConstants
from softseam_services.body.errors import LawError
from softseam_services.body.materials import point
from softseam_services.body.materials.prototype import MAX_PARAMETERS, RESPOND, RESPONSE
from softseam_services.jit import PrototypeError

__all__ = ["Law", "LawError"]


@dataclass(frozen=True)
class Law:
    """parameters  what the law's kernels take, of its specification and the elastic constants; names are the law's own
    response    psi [Pa] and its derivatives by the invariants, of what numba can compile; None of a law in `point`
    inline      number of its branch in `point`; 0 where kernels call `response` through its address
    splits      mu/2 I1 splits off its energy, so that hex27 takes the fast path (fem/kernels/cells.py)
    small       it holds for small strains only, and knows no turns
    state       how many numbers it remembers; 0 of an elastic law
    respond     of a law with state, in place of `response`
    """

    parameters: Callable[[Any, ElasticConstants], Sequence[float]]
    response: Callable[..., tuple[float, ...]] | None = None
    inline: int = 0
    splits: bool = False
    small: bool = False
    state: int = 0
    respond: Callable[..., tuple[float, float]] | None = None

    def __post_init__(self) -> None:
        if self.inline and self.inline not in point.BRANCHES:
            raise LawError(f"a law says that it is branch {self.inline} of materials.point, which has no such branch")
        if bool(self.inline) + (self.response is not None) + (self.respond is not None) != 1:
            raise LawError("a law needs a response(i1, i2, j, parameters) or a branch in materials.point, and not both")
        if (self.state > 0) != (self.respond is not None):
            raise LawError("a law with state needs a respond(F, state, dt, parameters, P, A, following), and its size")

    @cached_property
    def number(self) -> int:
        """By which kernels know the law: its branch in `point`, or the address of its compiled response.

        It is 0 of a law with state, so that no kernel that knows of none takes it.

        Raises LawError where the response does not compile.
        """
        if self.response is None:
            return self.inline
        try:
            return RESPONSE.compile(self.response)
        except PrototypeError as error:
            raise LawError(str(error)) from error

    @cached_property
    def address(self) -> int:
        """Of the compiled `respond`; 0 of a law without state. Raises LawError where it does not compile."""
        if self.respond is None:
            return 0
        try:
            return RESPOND.compile(self.respond)
        except PrototypeError as error:
            raise LawError(str(error)) from error

    def packed(self, spec: Any, elastic: ElasticConstants) -> Floats:
        """Parameters as kernels take them (MAX_PARAMETERS,). Raises LawError."""
        own = np.asarray(self.parameters(spec, elastic), dtype=np.float64)
        if own.ndim != 1 or len(own) > MAX_PARAMETERS or not np.isfinite(own).all():
            raise LawError(f"{spec.kind} has the parameters {own}: at most {MAX_PARAMETERS} finite numbers are taken")
        return np.concatenate([own, np.zeros(MAX_PARAMETERS - len(own))])
