"""What has every solver of this process return at its next iteration, with a step that it did not solve."""

from __future__ import annotations

import numpy as np

HALT = np.zeros(1, dtype=np.int32)
"""not 0 while they shall; kernels see it in their `Work`, so that another thread may set it while they run"""
