"""Where numbers stand in a row of contact between bodies of a pile, see `between`."""

POINT, CORNER, PLACE, OWN, OTHER = 0, 1, 4, 5, 6
N_INTS = 7
"""of a row: point and three corners, as rows of the pile's xw; place of the point among forces; numbers of its body and
of the other"""
SHARE, NORMAL, SOFT, GIVES, RUB, FORCE, HELD, BEGAN, FACED, YIELDS, SLIDES = 0, 3, 6, 7, 8, 9, 12, 15, 18, 21, 22
N_NUMBERS = 23
"""of a row: s (3,), n (3,), alpha [m/N], c/h^2 [1/kg], mu, f and t_0 (3,) [N], where the point and the place on the
face were as the substep began (3,) [m], and what guests add to c along n and across it, see `guests` [m/N]"""
