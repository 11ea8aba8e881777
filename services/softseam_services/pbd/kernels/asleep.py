"""Bodies of a pile that sleep: to the others they are obstacles, whose nodes do not give."""

from softseam_services.jit import njit

AWAKE, FELL, LIES = 0, 1, 2
"""of a body: whether it sleeps through a step; if it does, whether it did not through the step before, or did"""


@njit(cache=True, error_model="numpy", forceinline=True)
def row_inverse_mass(members, touch, body, node):
    """Inverse mass of a node in a row [1/kg]: none of a body that sleeps."""
    return members[body].parameters.inverse_mass[node] if touch.asleep[body] == AWAKE else 0.0


@njit(cache=True, error_model="numpy")
def stand(touch, meeting, held, kept, share):
    """kept (f, 3) [N] <- share of the forces on the points of a meeting that were held."""
    for side in range(2):
        begin, own = touch.place[meeting, side], touch.pair[meeting, side]
        for i in range(begin, begin + touch.first[own + 1] - touch.first[own]):
            for c in range(3):
                kept[i, c] = share * held[i, c]


@njit(cache=True, error_model="numpy")
def is_visited(touch, meeting, held, kept):
    """Whether a meeting has rows to be found and solved in a step that begins: one of its bodies is awake. Where none
    is, its forces (f, 3) [N] stand, as the step begins and as it ends."""
    a, b = touch.pair[meeting, 0], touch.pair[meeting, 1]
    visited = touch.asleep[a] == AWAKE or touch.asleep[b] == AWAKE
    if visited:
        touch.met[meeting, :] = 0.0
        stand(touch, meeting, held, kept, 0.0)
    elif not touch.stands[meeting]:
        stand(touch, meeting, held, kept, 1.0)
    touch.stands[meeting] = not visited
    return visited
