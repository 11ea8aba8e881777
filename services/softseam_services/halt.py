"""What has the solvers of a process return at their next iteration, with a step that they did not solve."""

import threading

import numpy as np
from numpy.typing import NDArray

HALT = np.zeros(1, dtype=np.int32)
"""of those that the main thread made, not 0 while they shall; another thread may set it while their kernels run"""


def own_halt() -> NDArray[np.int32]:
    """What a solver is to heed that this thread makes: in other threads than the main one, what nobody sets."""
    return HALT if threading.current_thread() is threading.main_thread() else np.zeros_like(HALT)
