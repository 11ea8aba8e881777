"""Bodies of a pile that sleep: to the others they are obstacles, whose nodes do not give."""

from softseam_services.jit import njit

AWAKE, FELL, LIES = 0, 1, 2
"""of a body: whether it sleeps through a step; if it does, whether it did not through the step before, or did"""


@njit(cache=True, error_model="numpy", forceinline=True)
def is_visited(touch, meeting):
    """Whether a meeting has rows to be found and solved: one of its bodies is awake."""
    return touch.asleep[touch.pair[meeting, 0]] == AWAKE or touch.asleep[touch.pair[meeting, 1]] == AWAKE


@njit(cache=True, error_model="numpy", forceinline=True)
def row_inverse_mass(members, touch, body, node):
    """Inverse mass of a node in a row [1/kg]: none of a body that sleeps."""
    return members[body].parameters.inverse_mass[node] if touch.asleep[body] == AWAKE else 0.0
