"""The natural logarithm from operations that vectorise; the library's is called number by number."""

import numpy as np

from .lanes import lane_kernel

LN_2 = 0.6931471805599453
ROOT_HALF = 0x3FE6A09E667F3BCD
"""the bits of sqrt(1/2)"""


@lane_kernel
def logarithm(x):
    """ln x of a normal positive number to 2 units in the last place.

    x = m 2^e with m in sqrt(1/2) .. sqrt(2), s = (m - 1)/(m + 1), ln x = e ln 2 + 2 artanh s, and |s| < 0.172 needs ten
    terms of artanh s = s + s^3/3 + s^5/5 + ...
    """
    bits = np.float64(x).view(np.int64)
    e = (bits - np.int64(ROOT_HALF)) >> np.int64(52)
    m = np.int64(bits - (e << np.int64(52))).view(np.float64)
    s = (m - 1.0) / (m + 1.0)
    z = s * s
    y = z * z
    u = y * y
    low = z * (1.0 / 3.0) + y * (1.0 / 5.0 + z * (1.0 / 7.0))
    high = (1.0 / 9.0 + z * (1.0 / 11.0)) + y * (1.0 / 13.0 + z * (1.0 / 15.0)) + u * (1.0 / 17.0 + z * (1.0 / 19.0))
    return e * LN_2 + (2.0 * s + 2.0 * s * (low + u * high))
