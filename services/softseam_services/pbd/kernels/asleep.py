"""Bodies of a pile that sleep: to the others they are obstacles, whose nodes do not give."""

from softseam_services.jit import njit

AWAKE, FELL, LIES = 0, 1, 2
"""of a body: whether it sleeps through a step; if it does, whether it did not through the step before, or did"""


@njit(cache=True, error_model="numpy", forceinline=True)
def gives(touch, body):
    """By how much of their inverse mass nodes of a body give: by nothing where it sleeps [1]."""
    return 1.0 if touch.asleep[body] == AWAKE else 0.0


@njit(cache=True, error_model="numpy", forceinline=True)
def awake_of(touch, meeting):
    """The bodies of a meeting; in place of one that sleeps the other."""
    a, b = touch.pair[meeting, 0], touch.pair[meeting, 1]
    return a if touch.asleep[a] == AWAKE else b, b if touch.asleep[b] == AWAKE else a
