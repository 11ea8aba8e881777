"""A sum of products, of which four go on at a time."""

from softseam_services.jit import njit


@njit(cache=True, error_model="numpy")
def dot(a, b):
    """Sum of a[i] b[i], in four sums."""
    s0 = s1 = s2 = s3 = 0.0
    whole = len(a) - len(a) % 4
    for i in range(0, whole, 4):
        s0 += a[i] * b[i]
        s1 += a[i + 1] * b[i + 1]
        s2 += a[i + 2] * b[i + 2]
        s3 += a[i + 3] * b[i + 3]
    for i in range(whole, len(a)):
        s0 += a[i] * b[i]
    return (s0 + s1) + (s2 + s3)
