"""What messages are made of: validated arrays, counts and names."""

from functools import partial
from typing import Annotated

import numpy as np
from numpy.typing import NDArray


class Array:
    """Shape and dtype that a tensor field must have; None leaves an axis free.

    `least` is the smallest value allowed; `unbounded` lets +inf through (NaN never).
    """

    __slots__ = ("dtype", "least", "name", "shape", "unbounded")

    def __init__(self, dtype: str, *shape: int | None, least: int | None = None, unbounded: bool = False) -> None:
        self.name = dtype
        self.dtype = np.dtype("<" + dtype)
        self.shape = shape
        self.least = least
        self.unbounded = unbounded


class Least:
    """The smallest value that an integer field may have."""

    __slots__ = ("value",)

    def __init__(self, value: int) -> None:
        self.value = value


class Name:
    """Marks a text that may stand in a key expression or a file name: letters, digits, _ and -, or empty.

    dotted  marks an id, which may be two names with a dot between them
    """

    __slots__ = ("dotted",)

    def __init__(self, dotted: bool = False) -> None:
        self.dotted = dotted


Count = Annotated[int, Least(0)]
NameText = Annotated[str, Name()]
IdText = Annotated[str, Name(dotted=True)]


Vectors = Annotated[NDArray[np.float64], Array("f8", None, 3)]
Scalars = Annotated[NDArray[np.float64], Array("f8", None)]
Vector3 = Annotated[NDArray[np.float64], Array("f8", 3)]
Matrix = Annotated[NDArray[np.float64], Array("f8", None, None)]
Wrenches = Annotated[NDArray[np.float64], Array("f8", None, 6)]
Quaternions = Annotated[NDArray[np.float64], Array("f8", None, 4)]
Distances = Annotated[NDArray[np.float64], Array("f8", None, unbounded=True)]
Ids = Annotated[NDArray[np.int32], Array("i4", None, least=0)]
ToolIds = Annotated[NDArray[np.int32], Array("i4", None, least=-1)]
Labels = Annotated[NDArray[np.int8], Array("i1", None)]
Stresses = Annotated[NDArray[np.float64], Array("f8", None, 8, 6)]
Internal = Annotated[NDArray[np.float64], Array("f8", None, 8, None)]
CellNodes = Annotated[NDArray[np.int32], Array("i4", None, 27, least=0)]
Octants = Annotated[NDArray[np.float64], Array("f8", None, 8)]
OctantIds = Annotated[NDArray[np.int32], Array("i4", None, 8, least=-1)]
Lines = Annotated[NDArray[np.int32], Array("i4", None, 2, least=0)]
Triangles = Annotated[NDArray[np.int32], Array("i4", None, 3, least=0)]

# defaults of fields that are left out where they say nothing
NO_VECTORS = partial(np.zeros, (0, 3))
NO_MATRIX = partial(np.zeros, (0, 0))
NO_SCALARS = partial(np.zeros, 0)
NO_INTERNAL = partial(np.zeros, (0, 8, 0))
AS_THE_SCENE = partial(np.eye, 3)
"""axes of cells that do not lie turned (3, 3)"""


def no_octants() -> NDArray[np.int32]:
    return np.zeros((0, 8), dtype=np.int32)


def no_lines() -> NDArray[np.int32]:
    return np.zeros((0, 2), dtype=np.int32)


def no_ids() -> NDArray[np.int32]:
    return np.zeros(0, dtype=np.int32)


def no_labels() -> NDArray[np.int8]:
    return np.zeros(0, dtype=np.int8)
